/* Current of the sides and temperature, by the ADC. */
#ifndef SENSING_H
#define SENSING_H
#include <stdint.h>

void sensing_init(void);
/* (interrupt) A strobe has begun, in which `side` shines (SIDES: none), for `left_us` from now. */
void sensing_strobe(uint8_t side, uint16_t left_us);
/* Hand what was measured to the core. */
void sensing_tell(void);

#endif
