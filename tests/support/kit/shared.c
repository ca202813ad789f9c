/* The kit's receiver for ctypes: one for all, and what it lets use as a whole number. */
#include "adhesion.h"

#include <stdlib.h>

adhesion_receiver_t *made(int accept_unprotected);
void fed(adhesion_receiver_t *receiver, uint32_t id, uint8_t flags, uint8_t length, const uint8_t *data, uint64_t now_us);
int32_t used(const adhesion_receiver_t *receiver, uint8_t axle, uint64_t now_us);
void freed(adhesion_receiver_t *receiver);

adhesion_receiver_t *made(int accept_unprotected)
{
    adhesion_receiver_t *const receiver = malloc(sizeof *receiver);
    adhesion_settings_t settings = adhesion_default_settings();
    settings.accept_unprotected = accept_unprotected != 0;
    if (receiver != NULL) {
        adhesion_init(receiver, &settings);
    }
    return receiver;
}

void fed(adhesion_receiver_t *receiver, uint32_t id, uint8_t flags, uint8_t length, const uint8_t *data, uint64_t now_us)
{
    (void)adhesion_feed(receiver, id, flags, length, data, now_us);
}

/* The lower end in 0.01 %, -1 for a fall-back, -2 where no limit is to be set nor lifted. */
int32_t used(const adhesion_receiver_t *receiver, uint8_t axle, uint64_t now_us)
{
    const adhesion_use_t use = adhesion_poll(receiver, axle, now_us);
    int32_t limit = -1;
    if (use.state == ADHESION_FRESH_VALID) {
        limit = (use.limit == ADHESION_LIMIT_NONE) ? -2 : (int32_t)use.lower_end;
    }
    return limit;
}

void freed(adhesion_receiver_t *receiver)
{
    free(receiver);
}
