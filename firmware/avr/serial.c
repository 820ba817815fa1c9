#include "serial.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>
#include <util/atomic.h>

#define BAUD 500000UL /* exact at 16 MHz */

/* Sizes are those of the indices or less, so that they wrap by themselves. */
#define RECEIVE_SIZE 128u
static volatile uint8_t received[RECEIVE_SIZE], receive_head, receive_tail, lost;
static volatile uint8_t to_send[256], send_head, send_tail;
static volatile bool sent_any;

void serial_init(void)
{
    UBRR0 = (uint16_t)(F_CPU / 8 / BAUD - 1);
    UCSR0A = _BV(U2X0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

ISR(USART_RX_vect)
{
    uint8_t status = UCSR0A;
    uint8_t byte = UDR0;
    uint8_t next = (uint8_t)((receive_head + 1) % RECEIVE_SIZE);
    if ((status & (_BV(FE0) | _BV(DOR0))) && lost < UINT8_MAX)
        lost++;
    if (next != receive_tail) {
        received[receive_head] = byte;
        receive_head = next;
    } else if (lost < UINT8_MAX) {
        lost++;
    }
}

ISR(USART_UDRE_vect)
{
    if (send_head == send_tail) {
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
        return;
    }
    UCSR0A = _BV(U2X0) | _BV(TXC0); /* writing one clears "all sent" */
    UDR0 = to_send[send_tail++];
    sent_any = true;
}

int16_t serial_take(void)
{
    if (receive_tail == receive_head)
        return -1;
    uint8_t byte = received[receive_tail];
    receive_tail = (uint8_t)((receive_tail + 1) % RECEIVE_SIZE);
    return byte;
}

uint8_t serial_take_lost(void)
{
    uint8_t count;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        count = lost;
        lost = 0;
    }
    return count;
}

static bool has_room(uint8_t count)
{
    return (uint8_t)(send_tail - send_head - 1) >= count;
}

bool serial_send(const uint8_t *bytes, uint8_t count, bool must)
{
    while (!has_room(count)) {
        if (!must)
            return false;
        wdt_reset(); /* 256 bytes leave in 5 ms */
    }
    /* The interrupt may be sending what came before: it must see the bytes before it sees their end. */
    uint8_t end = send_head;
    while (count--)
        to_send[end++] = *bytes++;
    send_head = end;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { UCSR0B |= _BV(UDRIE0); }
    return true;
}

bool serial_all_sent(void)
{
    return send_head == send_tail && (!sent_any || (UCSR0A & _BV(TXC0)));
}
