/* Camera trigger, strobe and side switches. */
#ifndef STROBE_H
#define STROBE_H

void strobe_init(void);

#endif
