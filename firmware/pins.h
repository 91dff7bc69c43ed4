/* Which pin does what (Arduino Uno and Nano names in brackets; drawn in WIRING.md). */
#ifndef GRAINRIG_PINS_H
#define GRAINRIG_PINS_H

#include <avr/io.h>

/* STEP [D8], DIR [D9], ENABLE, low is on [D10]. */
#define STEP_PORT PORTB
#define STEP_DDR DDRB
#define STEP_BIT _BV(PB0)
#define DIR_PORT PORTB
#define DIR_DDR DDRB
#define DIR_BIT _BV(PB1)
#define ENABLE_PORT PORTB
#define ENABLE_DDR DDRB
#define ENABLE_BIT _BV(PB2)
/* Reference switch to ground [D2]. */
#define HOME_PORT_IN PIND
#define HOME_PORT_OUT PORTD
#define HOME_BIT _BV(PD2)
/* Camera: shutter [D3] and focus [D4], each through an optocoupler. */
#define CAMERA_PORT PORTD
#define CAMERA_DDR DDRD
#define SHUTTER_BIT _BV(PD3)
#define FOCUS_BIT _BV(PD4)

#endif
