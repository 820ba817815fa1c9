/* What tells one start from the one before. */
#ifndef IDENTITY_H
#define IDENTITY_H
#include <stdint.h>

/* Count this start in the EEPROM; returns the number of it. */
uint16_t identity_count_start(void);

#endif
