/* Where a wheelset meets a rail with less adhesion: the first signs of it. As signals/drops.py and front.py.
 *
 * Onto a worse rail the linear model's innovations grow within a few ticks, those of the wet peak's model do not, while
 * the torque is as it was; or the torque of one wheelset falls, and that of those behind it does not.
 */
#include <math.h>
#include <string.h>

#include "lane.h"

enum { CHANNELS = WRCD_FRONT_CHANNELS, REFERENCE = 50, LENGTH = WRCD_FRONT_BLOCKS, WET = 1, LOOKS = 5 };
enum { COUNT = CHANNELS, RATIO, RATIO_COUNT, COLUMNS = WRCD_FRONT_COLUMNS };
static const int CHANNEL[CHANNELS] = {1, 3, 5, 6, 7}, NEWEST[LOOKS] = {1, 2, 4, 8, 12};
static const double WEIGHTS[CHANNELS] = {0.3, -1.0, 0.3, 0.3, 1.0}, MOST = 1.5;
static const double LIMITS[LOOKS] = {1.1, 0.75, 0.55, 0.5, 0.46};
static const double MIN_NEW = 0.5, MIN_REFERENCE = 0.9, STEADY = 0.1, STEADY_RATIO = 0.004, JOLT = 0.35;
static const double FALLEN = 0.85, HELD = 0.93, MIN_RATIO = 0.02, TORQUE_LATE = 5.0, JOLT_BLOCKS = 13.0, PAUSE = 50.0;
enum { TORQUE_NOW = 2, TORQUE_FROM = 8, TORQUE_TO = 18, STEADY_BLOCKS = 20 };

typedef double sums_of[LENGTH][COLUMNS]; /* of so many newest blocks */

static void sum_up(const wrcd_front *f, int axle, sums_of sums)
{
    memcpy(sums[0], f->block[axle][LENGTH - 1], sizeof sums[0]);
    for (int k = 1; k < LENGTH; k++)
        for (int c = 0; c < COLUMNS; c++)
            sums[k][c] = sums[k - 1][c] + f->block[axle][LENGTH - 1 - k][c];
}

/* Decades by which the newest blocks stand out of those before; NaN where either holds too little. */
static void decades_of(sums_of sums, int blocks, double decades[CHANNELS])
{
    const double *newer = sums[blocks - 1], *both = sums[blocks + REFERENCE - 1], count = both[COUNT] - newer[COUNT];
    const int few = newer[COUNT] < MIN_NEW * blocks * WRCD_BLOCK_TICKS
        || count < MIN_REFERENCE * REFERENCE * WRCD_BLOCK_TICKS;

    for (int c = 0; c < CHANNELS; c++)
        decades[c] = few ? NAN : 0.5 * log10((newer[c] / newer[COUNT]) / ((both[c] - newer[c]) / count));
}

static double clipped(double x) { return x < -MOST ? -MOST : x > MOST ? MOST : x; }

static double ratio_of(const double *sums, const double *before)
{
    const double torque = sums[RATIO] - (before ? before[RATIO] : 0.0);

    return torque / (sums[RATIO_COUNT] - (before ? before[RATIO_COUNT] : 0.0));
}

/* Whether an axle's torque has fallen while that of the axles behind it that have any has not. */
static int has_fallen(const wrcd_front *f, int axle, int axles, const double share[], const double was[])
{
    int beside = 0;

    if (!(was[axle] > MIN_RATIO && share[axle] < FALLEN))
        return 0;
    for (int other = 0; other < axles; other++)
        if ((f->behind[axle] >> other & 1) && was[other] > MIN_RATIO) {
            if (!(share[other] >= HELD))
                return 0;
            beside = 1;
        }
    return beside;
}

static void look(wrcd_front *f, int axle, sums_of sums, int fallen, double block_m)
{
    double late = fallen ? TORQUE_LATE : NAN, highest = NAN, lowest = NAN;
    double decades[CHANNELS], risen[LOOKS], spread[LOOKS], level[LOOKS];
    int jolted = 0, blocks = 0;

    for (int i = 0; i < LOOKS; i++) {
        decades_of(sums, NEWEST[i], decades);
        jolted = jolted || decades[WET] > JOLT;
        risen[i] = 0.0;
        for (int c = 0; c < CHANNELS; c++)
            risen[i] += WEIGHTS[c] * clipped(decades[c]);
        for (; blocks < NEWEST[i] + STEADY_BLOCKS; blocks++) {
            const double *block = f->block[axle][LENGTH - 1 - blocks], torque = block[RATIO] / block[RATIO_COUNT];
            highest = blocks == 0 || torque > highest || isnan(torque) ? torque : highest;
            lowest = blocks == 0 || torque < lowest || isnan(torque) ? torque : lowest;
            if (isnan(torque) || isnan(highest))
                highest = lowest = NAN;
        }
        spread[i] = highest - lowest;
        level[i] = highest;
    }
    f->jolt[axle] = jolted ? JOLT_BLOCKS : fmax(f->jolt[axle] - 1.0, 0.0);
    for (int i = 0; i < LOOKS; i++) {
        const int steady = spread[i] <= STEADY * level[i] + STEADY_RATIO;
        if (steady && f->jolt[axle] == 0.0 && risen[i] > LIMITS[i])
            late = fmin(late, NEWEST[i]);
        if (i == 0)
            f->steady[axle] = steady;
    }
    f->pause[axle] = fmax(f->pause[axle] - 1.0, 0.0);
    if (isfinite(late) && f->pause[axle] == 0.0) {
        f->met_m[axle] = f->way_m - late * block_m;
        f->pause[axle] = PAUSE;
    }
}

void wrcd_front_step(wrcd_front *f, int axles, int64_t number, const wrcd_result *result,
                     const double *torque_ratio, double tick_s)
{
    const int64_t block = number / WRCD_BLOCK_TICKS;
    const double block_m = f->speed_m_s * tick_s * WRCD_BLOCK_TICKS;
    double share[WRCD_MAX_AXLES], was[WRCD_MAX_AXLES];
    sums_of sums[WRCD_MAX_AXLES];

    for (int axle = 0; axle < axles; axle++) {
        if (block != f->newest) {
            if (block != f->newest + 1)
                memset(f->block[axle], 0, sizeof f->block[axle]);
            memmove(f->block[axle][0], f->block[axle][1], (LENGTH - 1) * sizeof f->block[axle][0]);
            memset(f->block[axle][LENGTH - 1], 0, sizeof f->block[axle][0]);
        }
        double *newest = f->block[axle][LENGTH - 1];
        if (result->in_window[axle] && !result->near_pulse[axle]) {
            for (int c = 0; c < CHANNELS; c++) {
                const double w = result->whitened[CHANNEL[c] / 2][CHANNEL[c] % 2][axle];
                newest[c] += w * w;
            }
            newest[COUNT] += 1.0;
        }
        if (isfinite(torque_ratio[axle])) {
            newest[RATIO] += torque_ratio[axle];
            newest[RATIO_COUNT] += 1.0;
        }
    }
    f->newest = block;
    for (int axle = 0; (number + 1) % WRCD_BLOCK_TICKS == 0 && axle < axles; axle++) {
        sum_up(f, axle, sums[axle]);
        was[axle] = ratio_of(sums[axle][TORQUE_TO - 1], sums[axle][TORQUE_FROM - 1]);
        share[axle] = ratio_of(sums[axle][TORQUE_NOW - 1], NULL) / was[axle];
    }
    for (int axle = 0; (number + 1) % WRCD_BLOCK_TICKS == 0 && axle < axles; axle++)
        look(f, axle, sums[axle], has_fallen(f, axle, axles, share, was), block_m);
}
