/*
 * Frames that wait in the example's queue, a pair of sockets in the place of a bus. Lines "WAIT_MS ID HEX", and for each
 * the reason for which axle 1 is not to be used when the frame is read after that time.
 */
#define _DEFAULT_SOURCE
#define main example_main
#include "example_socketcan.c"
#undef main

int main(void)
{
    unsigned wait_ms;
    unsigned id;
    char hex[17];
    int ends[2];
    if ((socketpair(AF_UNIX, SOCK_DGRAM, 0, ends) != 0) || !ask_for_stamps(ends[0])) {
        return 1;
    }
    while (scanf("%u %x %16s", &wait_ms, &id, hex) == 3) {
        adhesion_receiver_t receiver;
        struct can_frame frame = {.can_id = id, .len = 8U};
        for (size_t at = 0U; at < 8U; at++) {
            unsigned byte;
            if (sscanf(&hex[2U * at], "%2x", &byte) != 1) {
                return 2;
            }
            frame.data[at] = (uint8_t)byte;
        }
        adhesion_init(&receiver, NULL);
        if (write(ends[1], &frame, sizeof frame) != (ssize_t)sizeof frame) {
            return 3;
        }
        (void)usleep(1000U * wait_ms);
        if (!take(ends[0], &receiver)) {
            return 4;
        }
        printf("%d\n", (int)adhesion_poll(&receiver, 1U, now_us()).reason);
    }
    return 0;
}
