/* grainrig's stepper controller for the ATmega328P (Arduino Uno or Nano): takes frames, answers each, turns the stage and
 * works the camera's remote release. PROTOCOL.md says what is said. */
#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>
#include <string.h>

#include "frame.h"
#include "motion.h"
#include "pins.h"

#define BAUD 115200
#define BAUD_TOL 3 /* 2.1 % off, as on every Arduino at 16 MHz */
#include <util/setbaud.h>

#define PROTOCOL 1
#define VERSION "1.0.0"

/* Serial line: what came, what is to go. Sizes are powers of two. */
#define RING 128
static volatile char in[RING], out[RING];
static volatile uint8_t in_head, in_tail, out_head, out_tail;

ISR(USART_RX_vect) {
    char byte = (char)UDR0;
    uint8_t next = (in_head + 1) & (RING - 1);
    if (next == in_tail) return; /* full: the frame is damaged, as its CRC will tell */
    in[in_head] = byte;
    in_head = next;
}

ISR(USART_UDRE_vect) {
    if (out_tail == out_head) {
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
        return;
    }
    UDR0 = (uint8_t)out[out_tail];
    out_tail = (out_tail + 1) & (RING - 1);
}

static void send(const char *text, uint8_t length) {
    for (uint8_t k = 0; k < length; k++) {
        uint8_t next = (out_head + 1) & (RING - 1);
        while (next == out_tail) wdt_reset(); /* a frame of 64 takes 6 ms to go */
        out[out_head] = text[k];
        out_head = next;
        UCSR0B |= _BV(UDRIE0);
    }
}

static uint32_t boot;
static uint32_t uptime_ms, heard_ms;
static uint32_t silence_ms; /* with no frame for so long, stop and let go; 0: never */
static struct motion_settings settings;
static bool configured, silenced;

/* The camera's release: focus, then shutter too, each for its time. */
static int32_t shot;
static uint16_t focus_left_ms, shutter_left_ms;

/* The answer to the frame before, for a host that did not get it. */
static bool answered;
static uint8_t last_seq;
static uint16_t last_crc;
static char answer[FRAME_MOST + 1];
static uint8_t answer_length;

static bool numbers(const char *text, int32_t *into, uint8_t count) {
    for (uint8_t k = 0; k < count; k++)
        if (!frame_number(&text, &into[k])) return false;
    while (*text == ' ') text++;
    return !*text;
}

static bool within(int32_t value, int32_t low, int32_t high) { return value >= low && value <= high; }

static const char *configure(const char *text) {
    /* speed, acceleration, homing speed, low, high, flags, silence in seconds */
    int32_t n[7];
    if (!numbers(text, n, 7)) return "err syntax";
    if (!within(n[0], SPEED_LEAST, SPEED_MOST) || !within(n[1], ACCELERATION_LEAST, ACCELERATION_MOST) ||
        !within(n[2], SPEED_LEAST, SPEED_MOST) || n[3] > n[4] || !within(n[5], 0, 3) || !within(n[6], 0, 86400))
        return "err range";
    if (motion_state() != MOTION_IDLE) return "err busy";
    settings = (struct motion_settings){.speed = n[0], .acceleration = n[1], .homing_speed = n[2], .low = n[3], .high = n[4],
                                        .invert = n[5] & 1, .has_switch = n[5] & 2};
    silence_ms = (uint32_t)n[6] * 1000;
    motion_set(&settings);
    configured = true;
    return "ok";
}

static const char *move(const char *text) {
    int32_t target;
    if (!numbers(text, &target, 1)) return "err syntax";
    if (!configured) return "err unconfigured";
    if (!motion_homed()) return "err unhomed";
    if (!within(target, settings.low, settings.high)) return "err limit";
    if (motion_state() != MOTION_IDLE) return motion_target() == target && motion_state() == MOTION_MOVING ? "ok" : "err busy";
    motion_go(target);
    return "ok";
}

static const char *home(const char *text) {
    int32_t most;
    if (!numbers(text, &most, 1)) return "err syntax";
    if (!configured) return "err unconfigured";
    if (!settings.has_switch) return "err noswitch";
    if (most < 1) return "err range";
    if (motion_state() == MOTION_HOMING) return "ok";
    if (motion_state() != MOTION_IDLE) return "err busy";
    motion_enable(true);
    motion_home(most);
    return "ok";
}

static const char *zero(void) {
    if (!configured) return "err unconfigured";
    if (motion_state() != MOTION_IDLE) return "err busy";
    motion_enable(true);
    motion_zero();
    return "ok";
}

static const char *photograph(const char *text) {
    int32_t n[3];
    if (!numbers(text, n, 3)) return "err syntax";
    if (n[0] < 1 || !within(n[1], 0, 60000) || !within(n[2], 1, 60000)) return "err range";
    if (n[0] == shot) return "ok"; /* asked again: the shutter has heard it */
    if (shutter_left_ms) return "err busy";
    shot = n[0];
    focus_left_ms = (uint16_t)n[1];
    shutter_left_ms = (uint16_t)n[2];
    CAMERA_PORT |= focus_left_ms ? FOCUS_BIT : FOCUS_BIT | SHUTTER_BIT;
    return "ok";
}

static void status(char *at) {
    uint8_t flags = (uint8_t)(motion_homed() << 0 | motion_enabled() << 1 | motion_switch() << 2 | configured << 3 |
                              (shutter_left_ms != 0) << 4 | silenced << 5);
    at = frame_put(at, "ok ");
    at = frame_put_number(at, motion_position());
    at = frame_put(at, " ");
    at = frame_put_number(at, motion_target());
    *at++ = ' ';
    *at++ = "imsh"[motion_state()];
    *at++ = ' ';
    at = frame_put_hex(at, flags, 2);
    at = frame_put(at, " ");
    frame_put_hex(at, boot, 8);
}

static void identify(char *at) {
    at = frame_put(at, "ok grainrig ");
    at = frame_put_number(at, PROTOCOL);
    at = frame_put(at, " " VERSION " ");
    frame_put_hex(at, boot, 8);
}

/* Does what a body asks for and writes what is answered. */
static void obey(const char *body, char *reply) {
    const char *rest = body + 1;
    const char *said = "err unknown";
    bool alone = !*rest;
    switch (*body) {
    case 'I': if (alone) { identify(reply); return; } break;
    case 'S': if (alone) { status(reply); return; } break;
    case 'C': said = configure(rest); break;
    case 'M': said = move(rest); break;
    case 'H': said = home(rest); break;
    case 'Z': if (alone) said = zero(); break;
    case 'X': if (alone) { motion_stop(); said = "ok"; } break;
    case 'R': if (alone) { motion_stop(); if (motion_state() == MOTION_IDLE) { motion_enable(false); said = "ok"; } else said = "err busy"; } break;
    case 'P': said = photograph(rest); break;
    }
    strcpy(reply, said);
}

static void answer_frame(const struct frame_reader *frame) {
    heard_ms = uptime_ms;
    silenced = false;
    if (!(answered && frame->seq == last_seq && frame->crc == last_crc)) {
        char reply[BODY_MOST + 1];
        obey(frame->body, reply);
        answer_length = frame_write(answer, '=', frame->seq, reply);
        answered = true;
        last_seq = frame->seq;
        last_crc = frame->crc;
    }
    send(answer, answer_length);
}

static void announce(const char *body) {
    char line[FRAME_MOST + 1];
    send(line, frame_write(line, '!', 0, body));
}

static void banner(void) {
    char body[BODY_MOST + 1];
    char *at = frame_put(body, "grainrig ");
    at = frame_put_number(at, PROTOCOL);
    at = frame_put(at, " " VERSION " ");
    frame_put_hex(at, boot, 8);
    announce(body);
}

static void each_ms(void) {
    uptime_ms++;
    if (focus_left_ms) {
        if (!--focus_left_ms) CAMERA_PORT |= SHUTTER_BIT;
    } else if (shutter_left_ms && !--shutter_left_ms) {
        CAMERA_PORT &= (uint8_t)~(FOCUS_BIT | SHUTTER_BIT);
    }
    if (silence_ms && uptime_ms - heard_ms >= silence_ms && motion_enabled()) {
        /* Nobody is there: do not heat a motor for nobody, nor go on turning. */
        motion_stop();
        if (motion_state() == MOTION_IDLE) {
            motion_enable(false);
            silenced = true;
        }
    }
}

/* After a watchdog's reset the watchdog stays on. */
void watchdog_off(void) __attribute__((naked, used, section(".init3")));
void watchdog_off(void) {
    MCUSR = 0;
    wdt_disable();
}

int main(void) {
    /* One more at each start: a host that sees it change knows that the position is lost. */
    uint32_t *kept = 0;
    boot = eeprom_read_dword(kept) + 1;
    eeprom_update_dword(kept, boot);
    motion_begin();
    CAMERA_DDR |= FOCUS_BIT | SHUTTER_BIT;
    UBRR0H = UBRRH_VALUE;
    UBRR0L = UBRRL_VALUE;
#if USE_2X
    UCSR0A |= _BV(U2X0);
#endif
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
    /* Timer 2: a flag each millisecond, looked at in the loop, so that no interrupt delays a step for it. */
    TCCR2A = _BV(WGM21);
    TCCR2B = _BV(CS22);
    OCR2A = 249;
    wdt_enable(WDTO_250MS);
    sei();
    banner();
    static struct frame_reader reader;
    for (;;) {
        wdt_reset();
        if (TIFR2 & _BV(OCF2A)) {
            TIFR2 = _BV(OCF2A);
            each_ms();
        }
        motion_poll();
        if (in_tail == in_head) continue;
        char byte = in[in_tail];
        in_tail = (in_tail + 1) & (RING - 1);
        switch (frame_take(&reader, byte)) {
        case FRAME_GOOD: answer_frame(&reader); break;
        case FRAME_BAD: announce("nak"); break;
        case FRAME_NONE: break;
        }
    }
}
