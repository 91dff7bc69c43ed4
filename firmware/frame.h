/* Frames of the serial protocol: ASCII, a line each, with a sequence number and a CRC-16 both ways. PROTOCOL.md is the
 * reference. This file knows nothing of the chip, so that the same code is compiled and tried out on a computer. */
#ifndef GRAINRIG_FRAME_H
#define GRAINRIG_FRAME_H

#include <stdbool.h>
#include <stdint.h>

/* Longest frame, its ':' and line feed included. */
#define FRAME_MOST 64
/* Longest body. */
#define BODY_MOST (FRAME_MOST - 10)

enum frame_seen {
    FRAME_NONE, /* nothing yet */
    FRAME_GOOD, /* a whole frame: `seq`, `body` and `crc` are set */
    FRAME_BAD,  /* a frame that is damaged or too long: to be answered by a nak */
};

struct frame_reader {
    uint8_t seq;
    uint16_t crc;
    char body[BODY_MOST + 1];
    /* The bytes between ':' and the line feed, so far. */
    char text[FRAME_MOST];
    uint8_t length;
    bool inside;
};

uint16_t frame_crc(const char *text, uint8_t length);

/* Takes one byte. */
enum frame_seen frame_take(struct frame_reader *reader, char byte);

/* Writes `mark`, the sequence number, the body, the CRC and a line feed; `out` holds FRAME_MOST + 1 bytes. Bodies are the
 * firmware's own and short enough. Returns the length. */
uint8_t frame_write(char *out, char mark, uint8_t seq, const char *body);

/* Reads a whole decimal number and moves on behind it; false where there is none, or where it does not fit 32 bits. */
bool frame_number(const char **text, int32_t *number);

/* Appends to a text. */
char *frame_put(char *at, const char *text);
char *frame_put_number(char *at, int32_t number);
char *frame_put_hex(char *at, uint32_t number, uint8_t digits);

#endif
