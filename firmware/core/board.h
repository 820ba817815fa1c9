/* What the core asks of a controller, and what a controller tells the core (led_frame.h, link.h).
 *
 * A new controller is a new folder beside avr/ that fills these functions; the core stays as it is.
 */
#ifndef BOARD_H
#define BOARD_H
#include <stdbool.h>
#include <stdint.h>

#define SIDES 4 /* top, right, bottom, left: bits 0 to 3 of a mask */

/* Keep interrupts out; calls nest. */
void board_lock(void);
void board_unlock(void);

/* Set the current of each side, 0 to 255 of full current. */
void board_set_levels(const uint8_t levels[SIDES]);

/* From the next whole period on: the strobe lights the last `strobe_us` of each period, the trigger
 * rises `lead_us` before the strobe (after it, if negative) and falls with it.  Strobe and trigger
 * must never be longer than asked, neither while one timing gives way to another. */
void board_set_timing(uint16_t period_us, uint16_t strobe_us, int16_t lead_us);

/* Switch all sides off now, even within a strobe.  Called from interrupts, too. */
void board_light_off(void);

/* True while the over-current line is active. */
bool board_overcurrent(void);

/* Queue bytes for the host.  Where there is no room, `must` waits for it; otherwise nothing is sent
 * and false returned. */
bool board_send(const uint8_t *bytes, uint8_t count, bool must);

/* Begin anew as after a watchdog reset, as soon as what is queued has been sent. */
void board_reset(void);

#endif
