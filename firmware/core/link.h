/* The host's line: requests run once each, responses, events. */
#ifndef LINK_H
#define LINK_H
#include <stdbool.h>
#include <stdint.h>

/* `boot_id` differs from that of the start before. */
void link_init(uint8_t reset_cause, uint16_t boot_id);

/* Take one byte from the host. */
void link_take(uint8_t byte);

/* Bytes were lost before they could be taken. */
void link_lost_bytes(uint8_t count);

/* Tell the host what has changed; called in every turn of the main loop. */
void link_tell(void);

#endif
