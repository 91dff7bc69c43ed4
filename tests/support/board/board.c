/* The controller's board, simulated: the real firmware on simavr, its serial line as a pseudo terminal, a stepper that counts the
 * edges on its pins, a reference switch and a camera release. A test program of its own: simavr's licence is the GPL.
 *
 * Says `PTY path` first, and `SHUTTER position` whenever the shutter's contact closes. Takes commands on stdin, a line each,
 * and answers each with a line on stdout:
 *   state           what the pins did: position, steps, steps without current, the shutter's pulses, the steps' timing
 *   position        where the motor is, microsteps
 *   time            how long the chip has run, µs of its own
 *   reset           the chip starts anew, as after a brown-out; its EEPROM stays
 *   switch stuck|open|normal
 *   noise P SEED    each byte either way is flipped or dropped with probability P
 *   mute on|off     what the firmware says is lost
 *   timing          forgets the steps' timing so far
 *   quit
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <signal.h>
#include <termios.h>
#include <unistd.h>

#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>

static avr_t *avr;
static int line = -1;
static avr_irq_t *byte_in, *home_pin;
static bool ready_for_byte;

/* The motor: microsteps from where it was put; the switch closes at or below its place. */
static long position, switch_at;
static bool direction, current, pulse;
static unsigned long steps, idle_steps;
enum { NORMAL, STUCK, OPEN } reference;

static avr_cycle_count_t last_step, shutter_up, focus_up;
static unsigned long shots;
static double shutter_ms, focus_ms;

/* The steps' intervals: how much each differs from the one before while the speed is constant is the jitter. */
#define KEPT (1 << 20)
static uint32_t interval[KEPT];
static unsigned long intervals;

static double noise;
static uint64_t seed;
static bool mute;
static unsigned long flipped, dropped;

static uint64_t draw(void) {
    uint64_t z = (seed += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

/* Whether a byte gets through, and what becomes of it. */
static bool through(uint8_t *byte) {
    if (noise <= 0 || (double)(draw() >> 11) / 9007199254740992.0 >= noise) return true;
    if (draw() & 1) {
        dropped++;
        return false;
    }
    flipped++;
    *byte ^= (uint8_t)(1u << (draw() & 7));
    return true;
}

static void show_switch(void) {
    bool closed = reference == STUCK || (reference == NORMAL && position <= switch_at);
    avr_raise_irq(home_pin, !closed);
}

/* A brown-out: the pins float, and what is outside stays. */
static void restart(void) {
    avr_reset(avr);
    current = direction = pulse = false;
    /* Only a change reaches the pin. */
    avr_raise_irq(home_pin, 1 - (home_pin->value & 1));
    show_switch();
}

static void on_step(avr_irq_t *irq, uint32_t value, void *data) {
    (void)irq, (void)data;
    bool rising = value && !pulse;
    pulse = value;
    if (!rising) return;
    if (!current) {
        idle_steps++;
        return;
    }
    steps++;
    position += direction ? 1 : -1;
    if (last_step && intervals < KEPT) interval[intervals++] = (uint32_t)(avr->cycle - last_step);
    last_step = avr->cycle;
    show_switch();
}

static void on_direction(avr_irq_t *irq, uint32_t value, void *data) {
    (void)irq, (void)data;
    direction = value;
    last_step = 0;
}

static void on_enable(avr_irq_t *irq, uint32_t value, void *data) {
    (void)irq, (void)data;
    current = !value;
}

static double ms_since(avr_cycle_count_t from) { return (double)(avr->cycle - from) * 1e3 / avr->frequency; }

static void on_shutter(avr_irq_t *irq, uint32_t value, void *data) {
    (void)irq, (void)data;
    if (value && !shutter_up) {
        shutter_up = avr->cycle;
        printf("SHUTTER %ld\n", position);
        fflush(stdout);
    }
    if (!value && shutter_up) {
        shots++;
        shutter_ms = ms_since(shutter_up);
        shutter_up = 0;
    }
}

static void on_focus(avr_irq_t *irq, uint32_t value, void *data) {
    (void)irq, (void)data;
    if (value && !focus_up) focus_up = avr->cycle;
    if (!value && focus_up) {
        focus_ms = ms_since(focus_up);
        focus_up = 0;
    }
}

static void on_byte_out(avr_irq_t *irq, uint32_t value, void *data) {
    (void)irq, (void)data;
    uint8_t byte = (uint8_t)value;
    /* Nobody reading is no reason to wait: a real line does not either. */
    if (!mute && through(&byte) && write(line, &byte, 1) < 0 && errno != EAGAIN && errno != EIO) perror("board: write");
}

static void on_ready(avr_irq_t *irq, uint32_t value, void *data) {
    (void)irq, (void)value;
    ready_for_byte = data != NULL;
}

static void state(void) {
    printf("{\"position\":%ld,\"steps\":%lu,\"idle_steps\":%lu,\"current\":%s,\"shots\":%lu,\"shutter_ms\":%.3f,\"focus_ms\":%.3f,"
           "\"flipped\":%lu,\"dropped\":%lu,\"cycles\":%llu,\"intervals_us\":[",
           position, steps, idle_steps, current ? "true" : "false", shots, shutter_ms, focus_ms, flipped, dropped,
           (unsigned long long)avr->cycle);
    for (unsigned long k = 0; k < intervals; k++) printf(k ? ",%.4f" : "%.4f", interval[k] * 1e6 / avr->frequency);
    puts("]}");
}

static bool command(const char *text) {
    double p;
    unsigned long long s;
    if (!strcmp(text, "state")) return state(), true;
    if (!strcmp(text, "position")) return printf("%ld\n", position), true;
    if (!strcmp(text, "time")) return printf("%llu\n", (unsigned long long)(avr->cycle * 1000000 / avr->frequency)), true;
    if (!strcmp(text, "quit")) exit(0);
    if (!strcmp(text, "timing")) intervals = 0, last_step = 0;
    else if (!strcmp(text, "reset")) restart();
    else if (!strcmp(text, "switch stuck")) reference = STUCK, show_switch();
    else if (!strcmp(text, "switch open")) reference = OPEN, show_switch();
    else if (!strcmp(text, "switch normal")) reference = NORMAL, show_switch();
    else if (!strcmp(text, "mute on")) mute = true;
    else if (!strcmp(text, "mute off")) mute = false;
    else if (sscanf(text, "noise %lf %llu", &p, &s) == 2) noise = p, seed = s;
    else return false;
    puts("ok");
    return true;
}

/* Commands from the test; its end is ours. */
static void commands(void) {
    static char text[256];
    static size_t length;
    char bytes[128];
    ssize_t got = read(STDIN_FILENO, bytes, sizeof bytes);
    if (got == 0) exit(0);
    for (ssize_t k = 0; k < got; k++) {
        if (bytes[k] != '\n') {
            if (length < sizeof text - 1) text[length++] = bytes[k];
            continue;
        }
        text[length] = 0;
        length = 0;
        if (!command(text)) printf("unknown: %s\n", text);
        fflush(stdout);
    }
}

static void line_in(void) {
    static uint8_t waiting[256];
    static ssize_t count, next;
    if (next == count) {
        next = 0;
        count = read(line, waiting, sizeof waiting);
        if (count <= 0) {
            count = 0;
            return;
        }
    }
    while (ready_for_byte && next < count) {
        uint8_t byte = waiting[next++];
        if (through(&byte)) avr_raise_irq(byte_in, byte);
    }
}

static void open_line(void) {
    int other;
    char name[128];
    struct termios raw;
    if (openpty(&line, &other, name, NULL, NULL)) {
        perror("board: openpty");
        exit(1);
    }
    /* Kept open on this side too, so that the line is there whether or not somebody holds it. */
    tcgetattr(other, &raw);
    cfmakeraw(&raw);
    tcsetattr(other, TCSANOW, &raw);
    fcntl(line, F_SETFL, O_NONBLOCK);
    fcntl(STDIN_FILENO, F_SETFL, O_NONBLOCK);
    printf("PTY %s\n", name);
    fflush(stdout);
}

int main(int count, char **words) {
    elf_firmware_t firmware = {0};
    if (count < 2 || elf_read_firmware(words[1], &firmware)) {
        fprintf(stderr, "board: no firmware\n");
        return 2;
    }
    for (int k = 2; k + 1 < count; k += 2) {
        if (!strcmp(words[k], "--switch-at")) switch_at = atol(words[k + 1]);
        if (!strcmp(words[k], "--at")) position = atol(words[k + 1]);
    }
    /* The test's end is ours, however it ends. */
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    avr = avr_make_mcu_by_name("atmega328p");
    avr_init(avr);
    avr->log = 0;
    firmware.frequency = 16000000;
    avr_load_firmware(avr, &firmware);
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(uint32_t)(AVR_UART_FLAG_STDIO | AVR_UART_FLAG_POOL_SLEEP);
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    byte_in = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), on_byte_out, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XON), on_ready, &ready_for_byte);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XOFF), on_ready, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), 0), on_step, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), 1), on_direction, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), 2), on_enable, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), 3), on_shutter, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), 4), on_focus, NULL);
    home_pin = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), 2);
    show_switch();
    open_line();
    for (;;) {
        for (int k = 0; k < 1000; k++) {
            int what = avr_run(avr);
            if (what == cpu_Done || what == cpu_Crashed) {
                fprintf(stderr, "board: the firmware crashed\n");
                _exit(3);
            }
        }
        line_in();
        commands();
    }
}
