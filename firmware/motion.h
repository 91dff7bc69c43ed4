/* The stepper: whole microsteps, trapezoidal speed, one interrupt a step. */
#ifndef GRAINRIG_MOTION_H
#define GRAINRIG_MOTION_H

#include <stdbool.h>
#include <stdint.h>

/* Limits of the settings, microsteps and seconds. */
#define SPEED_LEAST 10
#define SPEED_MOST 8000
#define ACCELERATION_LEAST 10
#define ACCELERATION_MOST 200000

enum motion_state { MOTION_IDLE, MOTION_MOVING, MOTION_STOPPING, MOTION_HOMING };

struct motion_settings {
    int32_t speed;        /* microsteps a second */
    int32_t acceleration; /* microsteps a second, each second */
    int32_t homing_speed; /* microsteps a second, without a ramp */
    int32_t low, high;    /* soft limits, microsteps */
    bool invert;          /* the other sense of rotation */
    bool has_switch;      /* a reference switch between D2 and ground */
};

void motion_begin(void);
void motion_set(const struct motion_settings *settings);

/* Turns the driver's current on or off; without it the position is not known any more. */
void motion_enable(bool on);
bool motion_enabled(void);

/* Goes to an absolute position. To be called at rest, enabled. */
void motion_go(int32_t target);
/* Looks for the reference, over at most so many microsteps a leg. */
void motion_home(int32_t most);
/* Calls the present position zero. */
void motion_zero(void);
/* Stops along the ramp. */
void motion_stop(void);
/* To be called again and again: takes the next leg of homing. */
void motion_poll(void);

int32_t motion_position(void);
int32_t motion_target(void);
enum motion_state motion_state(void);
/* Whether the position is known: homed or zeroed, and held ever since. */
bool motion_homed(void);
bool motion_switch(void);

#endif
