/* The clock of the emulated board: see clock.h.
 *
 * Copyright (C) 2026 the cornertouchd authors
 *
 * This test program is linked with libsimavr and is, like it, free software under the GNU General
 * Public License, version 3 or later: https://www.gnu.org/licenses/.  It comes WITHOUT ANY WARRANTY.
 * It is no part of cornertouchd, which is under the MIT licence and only talks to it.
 */
#define _GNU_SOURCE
#include "clock.h"

#include <time.h>

static double begun_s;
static avr_cycle_count_t begun;

double now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void clock_set(avr_t *avr)
{
    begun_s = now_s();
    begun = avr->cycle;
}

double clock_of(const avr_t *avr)
{
    return begun_s + (double)(avr->cycle - begun) / avr->frequency;
}
