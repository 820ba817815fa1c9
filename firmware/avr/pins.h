/* Where everything is connected on an Arduino Uno or Nano; wiring.svg draws it.
 *
 *   PB1 D9   OC1A   camera trigger          PD4 D4   top side on
 *   PB2 D10  OC1B   strobe                  PD7 D7   right side on
 *   PD6 D6   OC0A   top current             PB0 D8   bottom side on
 *   PD5 D5   OC0B   right current           PB4 D12  left side on
 *   PB3 D11  OC2A   bottom current          PD2 D2   INT0, over-current, active low
 *   PD3 D3   OC2B   left current            PB5 D13  LED of the board: armed
 *   A0..A3   current sense top, right, bottom, left        A4   temperature, TMP36
 */
#ifndef PINS_H
#define PINS_H
#include <avr/io.h>

#define TRIGGER_PIN _BV(PB1)
#define STROBE_PIN _BV(PB2)
#define TOP_ON _BV(PD4)
#define RIGHT_ON _BV(PD7)
#define BOTTOM_ON _BV(PB0)
#define LEFT_ON _BV(PB4)
#define LEVELS_ON_B _BV(PB3)
#define LEVELS_ON_D (_BV(PD3) | _BV(PD5) | _BV(PD6))
#define OVERCURRENT_PIN _BV(PD2)
#define ARMED_LED _BV(PB5)
#define TEMPERATURE_CHANNEL 4

#endif
