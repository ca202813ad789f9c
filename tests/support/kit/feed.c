/*
 * A receiver that is told frames by lines "NOW_US AXLE ID FLAGS HEX" (HEX "-": no bytes), and answers each with the
 * verdict and with what to use of the axle then: "VERDICT STATE REASON LIMIT MU HALF LOWER USED SHOWN AGE SURFACE CONTACT".
 */
#include "adhesion.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

int main(void)
{
    static adhesion_receiver_t receiver;
    adhesion_settings_t settings = adhesion_default_settings();
    uint64_t now_us;
    unsigned axle;
    unsigned id;
    unsigned flags;
    char hex[129];
    settings.accept_unprotected = true;
    adhesion_init(&receiver, &settings);
    while (scanf("%" SCNu64 " %u %x %u %128s", &now_us, &axle, &id, &flags, hex) == 5) {
        uint8_t data[64] = {0};
        const size_t length = (hex[0] == '-') ? 0U : strlen(hex) / 2U;
        for (size_t at = 0U; at < length; at++) {
            unsigned byte;
            if (sscanf(&hex[2U * at], "%2x", &byte) != 1) {
                return 2;
            }
            data[at] = (uint8_t)byte;
        }
        const adhesion_verdict_t verdict =
            adhesion_feed(&receiver, id, (uint8_t)flags, (uint8_t)length, data, now_us);
        const adhesion_use_t use = adhesion_poll(&receiver, (uint8_t)axle, now_us);
        printf("%d %d %d %d %u %u %u %u %u %u %d %d\n", (int)verdict, (int)use.state, (int)use.reason, (int)use.limit,
               use.mu_available, use.half_width, use.lower_end, use.mu_used, use.mu_shown, use.sample_age_ms,
               (int)use.surface, (int)use.contact);
    }
    return 0;
}
