/* What each request does, and what it is answered. */
#ifndef REQUESTS_H
#define REQUESTS_H
#include <stdint.h>

/* What the line knows and the answers need. */
typedef struct {
    uint8_t reset_cause;
    uint16_t boot_id;
    uint8_t report_every; /* a FRAME event every so many periods; 0: none */
    uint16_t bad_crc, malformed, too_long, repeated; /* frames received; they wrap around */
} line_t;

/* Run a request.  Writes at most PAYLOAD_MAX - 1 bytes to `answer` and returns a STATUS_. */
uint8_t run_request(line_t *line, uint8_t op, const uint8_t *payload, uint8_t count,
                    uint8_t *answer, uint8_t *answer_count);

#endif
