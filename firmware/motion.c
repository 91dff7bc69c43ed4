#include "motion.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <math.h>
#include <util/atomic.h>
#include <util/delay.h>

#include "pins.h"

/* Timer 1 counts half microseconds and is never stopped or set back: each step's time is the one before plus the interval,
 * so that a late interrupt delays a step and not those after it. */
#define TICKS_PER_S 2000000UL
/* Intervals are kept in 1/16 of a tick: the ramp's recurrence loses less to rounding. */
#define FRACTION 4
/* A longer interval than the timer's 16 bits is waited for in pieces. */
#define PIECE 40000u
/* Time from enabling the driver to the first step, and from the direction to the step. */
#define WAKE_US 2000

static struct motion_settings set;
static uint32_t first_interval, cruise_interval;

/* Of the interrupt while it is on. */
static volatile int32_t position;
static volatile bool running;
static volatile uint32_t left;
static uint32_t interval, top_interval, wait;
static uint32_t ramp; /* steps that the way to a stop takes at the present speed */
static bool up, seeking, seek_closed;
static volatile bool found;

static int32_t target;
static bool enabled, homed;
static enum motion_state state;
static uint8_t leg;
static int32_t leg_most;

bool motion_switch(void) { return !(HOME_PORT_IN & HOME_BIT); }

/* The time of the next step. David Austin's recurrence (Embedded Systems Programming, January 2005): from one interval to the
 * next at constant acceleration, without a root. */
static void next_interval(void) {
    if (left <= ramp) {
        /* Braking: as many steps are left as the ramp up took. */
        interval += 2 * interval / (4 * ramp - 1);
        ramp--;
    } else if (interval > top_interval) {
        uint32_t next = interval - 2 * interval / (4 * (ramp + 1) + 1);
        if (next < top_interval) {
            interval = top_interval;
        } else {
            interval = next;
            ramp++;
        }
    }
}

ISR(TIMER1_COMPA_vect) {
    if (wait > PIECE) {
        wait -= PIECE;
        OCR1A += (uint16_t)(wait > PIECE ? PIECE : wait);
        return;
    }
    STEP_PORT |= STEP_BIT;
    position += up ? 1 : -1;
    left--;
    if (seeking && motion_switch() == seek_closed) {
        found = true;
        left = 0;
    }
    if (left) {
        next_interval();
        wait = interval >> FRACTION;
        OCR1A += (uint16_t)(wait > PIECE ? PIECE : wait);
    } else {
        TIMSK1 = 0;
        running = false;
        _delay_us(2);
    }
    STEP_PORT &= (uint8_t)~STEP_BIT;
}

static void begin(bool upwards, uint32_t steps) {
    up = upwards;
    if (up != set.invert) DIR_PORT |= DIR_BIT;
    else DIR_PORT &= (uint8_t)~DIR_BIT;
    left = steps;
    ramp = 0;
    found = false;
    if (!steps) return;
    running = true;
    wait = interval >> FRACTION;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        OCR1A = TCNT1 + (uint16_t)(wait > PIECE ? PIECE : wait);
        TIFR1 = _BV(OCF1A);
        TIMSK1 = _BV(OCIE1A);
    }
}

void motion_begin(void) {
    STEP_DDR |= STEP_BIT;
    DIR_DDR |= DIR_BIT;
    ENABLE_PORT |= ENABLE_BIT; /* low turns the current on */
    ENABLE_DDR |= ENABLE_BIT;
    HOME_PORT_OUT |= HOME_BIT; /* pull-up */
    TCCR1A = 0;
    TCCR1B = _BV(CS11);
}

void motion_set(const struct motion_settings *settings) {
    set = *settings;
    cruise_interval = (TICKS_PER_S << FRACTION) / (uint32_t)set.speed;
    /* The recurrence's error at its first step is made up for by 0.676. */
    float first = 0.676f * (float)(TICKS_PER_S << FRACTION) * sqrtf(2.0f / (float)set.acceleration);
    first_interval = (uint32_t)first;
    if (first_interval < cruise_interval) first_interval = cruise_interval;
}

void motion_enable(bool on) {
    if (on && !enabled) {
        ENABLE_PORT &= (uint8_t)~ENABLE_BIT;
        _delay_us(WAKE_US);
    }
    if (!on) {
        ENABLE_PORT |= ENABLE_BIT;
        homed = false;
    }
    enabled = on;
}

bool motion_enabled(void) { return enabled; }

void motion_go(int32_t to) {
    int32_t way = to - position;
    target = to;
    if (!way) return;
    seeking = false;
    interval = first_interval;
    top_interval = cruise_interval;
    state = MOTION_MOVING;
    begin(way > 0, way > 0 ? (uint32_t)way : 0u - (uint32_t)way);
}

/* Homing, leg by leg: off the switch if it stands on it, onto it, and slowly off it. Zero is where it opens, always
 * approached from the same side. */
static void seek(uint8_t which) {
    leg = which;
    seeking = true;
    seek_closed = which == 1;
    uint32_t speed = (uint32_t)(which == 2 ? (set.homing_speed + 3) / 4 : set.homing_speed);
    interval = (TICKS_PER_S << FRACTION) / speed;
    top_interval = interval; /* no ramp */
    begin(which != 1, (uint32_t)leg_most);
}

void motion_home(int32_t most) {
    homed = false;
    leg_most = most;
    target = 0;
    state = MOTION_HOMING;
    seek(motion_switch() ? 0 : 1);
}

void motion_zero(void) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { position = 0; }
    target = 0;
    homed = true;
}

void motion_stop(void) {
    if (state == MOTION_IDLE) return;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        uint32_t needed = ramp ? ramp : 1;
        if (left > needed) left = needed;
    }
    if (state == MOTION_HOMING) homed = false;
    state = MOTION_STOPPING;
}

void motion_poll(void) {
    if (running || state == MOTION_IDLE) return;
    if (state == MOTION_HOMING) {
        if (found && leg < 2) {
            seek(leg == 0 ? 1 : 2);
            return;
        }
        if (found) motion_zero();
    }
    state = MOTION_IDLE;
}

int32_t motion_position(void) {
    int32_t now;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { now = position; }
    return now;
}

int32_t motion_target(void) { return target; }
enum motion_state motion_state(void) { return state; }
bool motion_homed(void) { return homed; }
