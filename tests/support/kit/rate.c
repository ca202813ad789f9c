/* braking_rate.c's answers. First it says the default limits, and takes a line of eleven numbers, those to try.
 * Then lines "OP NOW_US POSITION_MM A B": OP is init, take (lower end, estimate), silent (the same, not Valid), tests,
 * tested or needed (speed, rest). */
#include "braking_rate.c"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

static void show(const braking_rate_limits_t *l)
{
    printf("%u %u %u %u %u %u %u %u %u %u %u\n", l->dry, l->cautious, l->least, l->kept_pct, l->falls_to_pct, l->holds_us,
           l->stands_us, l->same_mm, l->tests, l->test_us, l->found_us);
}

int main(void)
{
    braking_rate_t rate;
    braking_rate_init(&rate, NULL);
    show(&rate.limits);
    braking_rate_limits_t given;
    if (scanf("%" SCNu32 " %" SCNu32 " %" SCNu32 " %" SCNu8 " %" SCNu8 " %" SCNu32 " %" SCNu32 " %" SCNu32 " %" SCNu32
              " %" SCNu32 " %" SCNu32,
              &given.dry, &given.cautious, &given.least, &given.kept_pct, &given.falls_to_pct, &given.holds_us,
              &given.stands_us, &given.same_mm, &given.tests, &given.test_us, &given.found_us) != 11) {
        return 2;
    }
    braking_rate_init(&rate, &given);
    char op[8];
    uint64_t now_us;
    int64_t position_mm;
    int64_t a;
    int64_t b;
    while (scanf("%7s %" SCNu64 " %" SCNd64 " %" SCNd64 " %" SCNd64, op, &now_us, &position_mm, &a, &b) == 5) {
        uint32_t said = 0U;
        if (strcmp(op, "init") == 0) {
            braking_rate_init(&rate, &given);
        } else if (strcmp(op, "tests") == 0) {
            said = braking_rate_tests(&rate, now_us, position_mm) ? 1U : 0U;
        } else if (strcmp(op, "tested") == 0) {
            braking_rate_tested(&rate, now_us, position_mm);
        } else if (strcmp(op, "needed") == 0) {
            said = braking_rate_needed((uint32_t)a, b);
        } else {
            const adhesion_advice_t advice = {
                .state = (strcmp(op, "take") == 0) ? ADHESION_FRESH_VALID : ADHESION_FALL_BACK,
                .deceleration_low = (uint16_t)a,
                .deceleration = (uint16_t)b,
            };
            braking_rate_take(&rate, now_us, position_mm, &advice);
        }
        printf("%u %u\n", said, braking_rate_rate(&rate, now_us, position_mm));
    }
    return 0;
}
