/* A start counter, spread over 32 words: a cell bears 100,000 writes, a board that restarts four
 * times a second (the watchdog) would wear out a single one in seven hours.
 *
 * Each start writes its number behind that of the one before; the last is where the row of
 * consecutive numbers ends.  A write that a power failure cut off ends the row, too.
 */
#include "identity.h"

#include <avr/eeprom.h>

#define WORDS 32u

static uint16_t EEMEM starts[WORDS];

uint16_t identity_count_start(void)
{
    uint8_t last = 0;
    uint16_t number = eeprom_read_word(&starts[0]);
    while (last + 1u < WORDS && eeprom_read_word(&starts[last + 1u]) == (uint16_t)(number + 1u)) {
        last++;
        number++;
    }
    number++;
    eeprom_update_word(&starts[(last + 1u) % WORDS], number);
    return number;
}
