/* What a good frame may still get wrong: a sensor that stands still while the train moves, a value that jumps. */
#include "core.h"

/* A sensor on a moving wheelset seldom says the same twice: its noise alone moves it by some steps of its converter. How
 * seldom is learnt; a run of equal values that would come about by chance once in so many frames is DOUBTED (the axle is
 * not Valid while it lasts, and for a window after it: once in some hours is seldom enough), and one that never would is
 * refused. */
static const double STUCK = 1e-12;
enum { MIN_RUN = 4 };
/* Of frames that repeat the one before: at first and at least, for a sensor that vibration dithers at speed is coarser
 * where the train is slow; and while it is learnt. */
static const double FIRST_SHARE = 0.05, FIRST_FRAMES = 20.0, MAX_FRAMES = 1000.0;
/* A run goes on oftener than frames repeat: most where the slow value is in the middle of a step (1.41). Of runs that go on
 * at most: a coarser sensor is not watched, it would be doubted after 0.7 s at 200 Hz. */
static const double GOES_ON = 1.5, MAX_SHARE = 0.9;
/* A change that no vehicle makes is reported for a frame, or for so long, if that is longer. A value further away is refused, and
 * believed if the next frame has it, too: a real step comes a frame late, a corrupted frame not at all. */
static const double STEP_US = 100000.0;

/* Equal neighbours that come about with less than a chance, where a share of the frames repeats. */
static double longest_run(double share, double chance)
{
    const double goes_on = fmin(GOES_ON * fmax(share, FIRST_SHARE), MAX_SHARE);

    return ceil(log(chance) / log(goes_on));
}

/* The repeats after which a sensor is doubted; 0: one so coarse is not watched. */
int wrcd_repeats_doubted(double share)
{
    return GOES_ON * share > MAX_SHARE ? 0 : (int)longest_run(share, DOUBTED);
}

/* Nothing that came before counts; how coarse a sensor is, is remembered. */
void wrcd_plausibility_reset(wrcd_input_state *s)
{
    s->seen = s->doubted = NAN;
    s->seen_us = WRCD_NEVER;
    s->run = s->jumped = 0;
    if (s->frames == 0.0) {
        s->share = FIRST_SHARE;
        s->frames = FIRST_FRAMES;
    }
}

/* How often it repeats itself; a stuck sensor must not teach that it always does. */
static void learn(wrcd_input_state *s)
{
    if (s->run >= MIN_RUN && (double)s->run >= longest_run(s->share, STUCK))
        return;
    for (int k = 0; k < (s->run < MIN_RUN ? s->run + 1 : MIN_RUN); k++) {
        s->frames = fmin(s->frames + 1.0, MAX_FRAMES);
        s->share += ((k < s->run ? 1.0 : 0.0) - s->share) / s->frames;
    }
}

/* Clipped, it repeats itself, however fine it is. */
static bool is_within(const wrcd_input *i, double value) { return i->first_end < value && value < i->last_end; }

static int stuck(const wrcd_input *i, wrcd_input_state *s, double value, int64_t stamp_us, bool moving)
{
    if (value == s->seen && moving) {
        s->run++;
        return s->run >= MIN_RUN && (double)s->run >= longest_run(s->share, STUCK) ? WRCD_REASON_STUCK : WRCD_REASON_NONE;
    }
    if (value != s->seen && is_within(i, s->seen))
        learn(s);
    s->run = 0;
    s->seen_us = stamp_us;
    s->seen = value;
    return WRCD_REASON_NONE;
}

/* Believed is what a second frame confirms, or what comes after a gap. */
static int jump(const wrcd_input *i, wrcd_input_state *s, double value, int64_t stamp_us)
{
    const int64_t age_us = stamp_us - s->seen_us;
    const double most = i->max_step * fmax(1.0, (double)age_us / STEP_US);

    s->jumped = 0;
    if (age_us <= i->timeout_us && fabs(value - s->seen) > most) {
        if (!(fabs(value - s->doubted) <= most)) {
            s->doubted = value;
            return WRCD_REASON_JUMP;
        }
        s->jumped = 1;
    }
    s->seen = value;
    s->seen_us = stamp_us;
    s->doubted = NAN;
    return WRCD_REASON_NONE;
}

/* Whether a value can be believed. Looking keeps state: look at every value of a frame. */
int wrcd_plausible(const wrcd_train *t, const reading *v, int64_t stamp_us)
{
    const wrcd_input *i = &t->input[v->input];
    wrcd_input_state *s = &t->input_state[v->input];

    if (i->quantity <= WRCD_LAT) {
        const double speed_m_s = fabs(wrcd_value_of(t, WRCD_SPEED, 0));
        return stuck(i, s, v->value, stamp_us, speed_m_s >= t->settings->min_speed_m_s);
    }
    if (i->quantity == WRCD_DIRECTION)
        return WRCD_REASON_NONE;
    const int reason = jump(i, s, v->value, stamp_us);
    if (s->jumped && i->quantity == WRCD_SPEED)
        t->core->speed_jumped = 1;
    return reason;
}

/* Whether a sensor has sent the same for longer than its time-out, and oftener than by chance, or is clipped. */
bool wrcd_is_unchanged(const wrcd_train *t, int input, int64_t now_us)
{
    const wrcd_input *i = &t->input[input];
    const wrcd_input_state *s = &t->input_state[input];

    return i->quantity <= WRCD_LAT && s->run >= MIN_RUN && s->seen_us != WRCD_NEVER && now_us - s->seen_us > i->timeout_us
        && (double)s->run >= (is_within(i, s->seen) ? longest_run(s->share, DOUBTED) : (double)MIN_RUN);
}
