/* The host's line: USART0 at 500 kbaud, 8N1, both ways through interrupts. */
#ifndef SERIAL_H
#define SERIAL_H
#include <stdbool.h>
#include <stdint.h>

void serial_init(void);
/* Return the next byte from the host, or -1. */
int16_t serial_take(void);
/* Return how many bytes were lost since it was last asked. */
uint8_t serial_take_lost(void);
bool serial_send(const uint8_t *bytes, uint8_t count, bool must);
/* True when nothing waits and the last bit has left. */
bool serial_all_sent(void);

#endif
