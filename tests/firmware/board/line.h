/* The emulated serial line: the controller's UART on a pseudo-terminal, with noise if wanted.
 *
 * Copyright (C) 2026 the cornertouchd authors
 *
 * This test program is linked with libsimavr and is, like it, free software under the GNU General
 * Public License, version 3 or later: https://www.gnu.org/licenses/.  It comes WITHOUT ANY WARRANTY.
 * It is no part of cornertouchd, which is under the MIT licence and only talks to it.
 */
#ifndef LINE_H
#define LINE_H
#include <sim_avr.h>
#include <stdio.h>

/* `link` becomes a symbolic link to the pseudo-terminal.  Returns 0, or -1 with errno. */
int line_plug(const char *link);
void line_unplug(void);
void line_connect(avr_t *avr);
/* A reset wipes all timers of the emulator. */
void line_reset(void);
/* Take what the host has written; called about four times a millisecond.  Returns whether the port
 * was opened in a way that resets the board. */
int line_poll(void);
/* Opening the port resets an Arduino, by DTR.  A pseudo-terminal does not tell that; a host that sets
 * another speed has just opened it. */
void line_set_opening_resets(int resets);
/* One bit in so many bytes is flipped, on the way in or out; 0: none. */
void line_set_noise(int in, int out);
/* While it is deaf the controller receives nothing. */
void line_set_deaf(int deaf);
/* Send bytes to the host that the controller never sent. */
void line_babble(int count);
void line_report(FILE *out);

#endif
