#include "frame.h"

/* CRC-16/CCITT-FALSE: polynomial 0x1021, first 0xFFFF, neither mirrored nor inverted. */
uint16_t frame_crc(const char *text, uint8_t length) {
    uint16_t crc = 0xFFFF;
    for (uint8_t k = 0; k < length; k++) {
        /* Eight bits at once: the polynomial's few terms as shifts. */
        uint8_t x = (uint8_t)(crc >> 8) ^ (uint8_t)text[k];
        x ^= x >> 4;
        crc = (uint16_t)(crc << 8) ^ (uint16_t)((uint16_t)x << 12) ^ (uint16_t)((uint16_t)x << 5) ^ x;
    }
    return crc;
}

static int8_t hex_value(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

/* Reads exactly so many hexadecimal digits. */
static bool hex(const char *text, uint8_t digits, uint16_t *number) {
    *number = 0;
    for (uint8_t k = 0; k < digits; k++) {
        int8_t value = hex_value(text[k]);
        if (value < 0) return false;
        *number = (uint16_t)(*number << 4) | (uint16_t)value;
    }
    return true;
}

/* A line is whole: `SS body*CCCC`. */
static enum frame_seen whole(struct frame_reader *r) {
    uint16_t seq, crc;
    if (r->length < 8) return FRAME_BAD;
    uint8_t star = r->length - 5;
    if (r->text[star] != '*' || !hex(r->text + star + 1, 4, &crc)) return FRAME_BAD;
    if (crc != frame_crc(r->text, star)) return FRAME_BAD;
    if (!hex(r->text, 2, &seq) || r->text[2] != ' ') return FRAME_BAD;
    uint8_t body = star - 3;
    for (uint8_t k = 0; k < body; k++) r->body[k] = r->text[k + 3];
    r->body[body] = 0;
    r->seq = (uint8_t)seq;
    r->crc = crc;
    return FRAME_GOOD;
}

enum frame_seen frame_take(struct frame_reader *r, char byte) {
    if (byte == ':') {
        /* Wherever it comes, a frame begins: the one before was cut off. */
        r->inside = true;
        r->length = 0;
        return FRAME_NONE;
    }
    if (!r->inside) return FRAME_NONE;
    if (byte == '\n') {
        r->inside = false;
        return whole(r);
    }
    /* The ':' and the line feed count too. */
    if (byte < ' ' || byte > '~' || r->length >= FRAME_MOST - 2) {
        r->inside = false;
        return FRAME_BAD;
    }
    r->text[r->length++] = byte;
    return FRAME_NONE;
}

char *frame_put(char *at, const char *text) {
    while (*text) *at++ = *text++;
    *at = 0;
    return at;
}

char *frame_put_hex(char *at, uint32_t number, uint8_t digits) {
    for (uint8_t k = digits; k-- > 0; number >>= 4) at[k] = "0123456789ABCDEF"[number & 15];
    at[digits] = 0;
    return at + digits;
}

char *frame_put_number(char *at, int32_t number) {
    char digits[10];
    uint8_t count = 0;
    uint32_t rest = number < 0 ? 0u - (uint32_t)number : (uint32_t)number;
    do {
        digits[count++] = (char)('0' + rest % 10);
        rest /= 10;
    } while (rest);
    if (number < 0) *at++ = '-';
    while (count) *at++ = digits[--count];
    *at = 0;
    return at;
}

bool frame_number(const char **text, int32_t *number) {
    const char *at = *text;
    while (*at == ' ') at++;
    bool negative = *at == '-';
    if (negative) at++;
    if (*at < '0' || *at > '9') return false;
    uint32_t value = 0;
    const uint32_t most = negative ? 2147483648u : 2147483647u;
    for (; *at >= '0' && *at <= '9'; at++) {
        uint8_t digit = (uint8_t)(*at - '0');
        if (value > (most - digit) / 10) return false;
        value = value * 10 + digit;
    }
    if (*at && *at != ' ') return false;
    *number = negative ? (int32_t)(0u - value) : (int32_t)value;
    *text = at;
    return true;
}

uint8_t frame_write(char *out, char mark, uint8_t seq, const char *body) {
    char *at = out;
    *at++ = mark;
    at = frame_put_hex(at, seq, 2);
    *at++ = ' ';
    at = frame_put(at, body);
    uint16_t crc = frame_crc(out + 1, (uint8_t)(at - out - 1));
    *at++ = '*';
    at = frame_put_hex(at, crc, 4);
    *at++ = '\n';
    *at = 0;
    return (uint8_t)(at - out);
}
