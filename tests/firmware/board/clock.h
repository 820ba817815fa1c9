/* The clock of the emulated board, which is that of the host: CLOCK_MONOTONIC.
 *
 * Copyright (C) 2026 the cornertouchd authors
 *
 * This test program is linked with libsimavr and is, like it, free software under the GNU General
 * Public License, version 3 or later: https://www.gnu.org/licenses/.  It comes WITHOUT ANY WARRANTY.
 * It is no part of cornertouchd, which is under the MIT licence and only talks to it.
 */
#ifndef CLOCK_H
#define CLOCK_H
#include <sim_avr.h>

/* What the host's clock says now. */
double now_s(void);
/* Let the board's clock go on from now. */
void clock_set(avr_t *avr);
/* What a real board's clock would say: an emulator that falls behind does its cycles later, and what
 * it sends comes later, but a board knows nothing of that. */
double clock_of(const avr_t *avr);

#endif
