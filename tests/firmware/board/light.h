/* The emulated LED frame: what shines when, measured in cycles of the controller.
 *
 * Copyright (C) 2026 the cornertouchd authors
 *
 * This test program is linked with libsimavr and is, like it, free software under the GNU General
 * Public License, version 3 or later: https://www.gnu.org/licenses/.  It comes WITHOUT ANY WARRANTY.
 * It is no part of cornertouchd, which is under the MIT licence and only talks to it.
 */
#ifndef LIGHT_H
#define LIGHT_H
#include <sim_avr.h>
#include <stdio.h>

#define SIDES 4

void light_connect(avr_t *avr);
/* The controller was reset: its pins are low. */
void light_reset(void);
/* Count anew. */
void light_zero(void);
/* Sides whose LEDs are open or shorted, as masks. */
void light_set_open(int mask);
void light_set_short(int mask);
void light_set_temperature_mv(int mv);
/* Write what was counted, as the inside of a JSON object. */
void light_report(FILE *out);
/* Write the flashes from number `first` on, each with its time, mask and levels. */
void light_report_flashes(FILE *out, unsigned long first);

#endif
