/* Calm stretches of a bogie's signals: some seconds of steady running on straight track, through a Hann window, as spectra
 * at some frequencies; and blocks of stretches of alike speed, as mean cross-spectra. The model is linear and stationary:
 * what is neither is left out. The leading wheelset's signals are taken a wheelbase earlier, so that both have met the same
 * track. The limits in the table are those of wrcd/fit/stretches.py, which looks at whole logs. */
#include "fit.h"

enum { QUARTERS = 4, RING = WRCD_FIT_RING };
static const double MIN_STRETCHES = 2.0; /* of a block */
enum { MOST, MEAN }; /* of a high-passed acceleration's size */
static const double MEAN_SIZE = 0.7979; /* over the standard deviation */
/* The gyros' zeros are medians of all stretches, which most of the time are straight: followed by steps (rad/s), from 0 on,
 * so that a first stretch that is absurd is forgotten. */
static const double FIRST_STEP = 0.02, LEAST_STEP = 1e-4;

static void follow_zero(const wrcd_fit_table *f, wrcd_bogie_state *b, int s)
{
    b->zeros += 1.0;
    for (int k = 0; k < 2; k++) {
        double mean = 0.0;
        for (int q = 0; q < QUARTERS; q++)
            mean += b->turning[s][q][k] / f->ticks;
        if (!isfinite(mean))
            continue;
        const double step = fmax(FIRST_STEP / b->zeros, LEAST_STEP);
        b->zero[k] += held(mean - b->zero[k], -step, step);
    }
}

static bool is_straight(const wrcd_fit_table *f, const wrcd_bogie_state *b, int s, double speed_m_s)
{
    double whole = 0.0, most = 0.0;

    for (int q = 0; q < QUARTERS; q++) {
        const double both = b->turning[s][q][0] + b->turning[s][q][1];
        const double yaw = 0.5 * ((double)QUARTERS * both / f->ticks - b->zero[0] - b->zero[1]);
        most = fmax(most, fabs(yaw));
        whole += yaw / (double)QUARTERS;
    }
    return most <= 2.0 * f->straight_1_m * speed_m_s && fabs(whole) <= f->straight_1_m * speed_m_s;
}

static bool is_calm(const wrcd_fit_table *f, wrcd_bogie_state *b, int s, double speed_m_s)
{
    bool is = !b->is_spoiled[s] && speed_m_s >= f->least_speed_m_s && b->fastest[s] - b->slowest[s] <= f->steady * speed_m_s;

    for (int c = 0; c < SIGNALS; c++)
        is = is && b->missing[s][c] <= f->most_missing * f->ticks;
    if (!is)
        return false;
    follow_zero(f, b, s);
    for (int k = 0; k < 2; k++) /* a dead accelerometer is not calm */
        is = is && b->high[s][k][MOST] * f->ticks * MEAN_SIZE < f->pulse_sigma * b->high[s][k][MEAN];
    return is && is_straight(f, b, s, speed_m_s);
}

/* Put a stretch's spectra into the block. What lies between its delay and the time of a wheelbase turns the trailing ones. */
static void add_to_block(const wrcd_fit_table *f, wrcd_bogie_state *b, int s, double speed_m_s)
{
    const double later_s = f->wheelbase_m / speed_m_s - b->delay[s] * f->tick_s, apart_hz = f->bins_apart / (f->ticks * f->tick_s);
    const double first = 2.0 * acos(-1.0) * f->first_bin / (f->ticks * f->tick_s);

    for (int bin = 0; bin < BINS; bin++) {
        const complex_number turn = c_turned((first + 2.0 * acos(-1.0) * apart_hz * bin) * later_s);
        complex_number x[SIGNALS];
        double *cross = b->block[bin];
        for (int c = 0; c < SIGNALS; c++) {
            x[c] = (complex_number){b->sum[s][bin][0][c], b->sum[s][bin][1][c]};
            x[c] = c < 2 ? x[c] : c_times(x[c], turn);
            *cross++ += c_square(x[c]);
        }
        for (int i = 0; i < SIGNALS; i++)
            for (int j = i + 1; j < SIGNALS; j++) {
                const complex_number of = c_times(x[i], c_conjugate(x[j]));
                *cross++ += of.re;
                *cross++ += of.im;
            }
    }
    b->block_first_m_s = b->block_stretches > 0 ? b->block_first_m_s : speed_m_s;
    b->block_m_s += speed_m_s;
    b->block_stretches++;
}

/* End a block. Returns whether there is enough in it; it then lies in cross, of_speed_m_s and of_stretches. One that ends while
 * another is looked at, as two short ones may, is dropped. */
static bool end_block(const wrcd_fit_table *f, wrcd_bogie_state *b)
{
    const double n = (double)b->block_stretches;
    const bool enough = n >= MIN_STRETCHES && b->pass == 0;

    if (enough) {
        const double scale = 8.0 / (3.0 * f->ticks * n); /* a Hann window's energy */
        for (int bin = 0; bin < BINS; bin++)
            for (int k = 0; k < AS_REAL; k++)
                b->cross[bin][k] = scale * b->block[bin][k];
        b->of_speed_m_s = b->block_m_s / n;
        b->of_stretches = n;
    }
    memset(b->block, 0, sizeof b->block);
    b->block_m_s = b->block_first_m_s = 0.0;
    b->block_stretches = 0;
    return enough;
}

static bool end_stretch(const wrcd_fit_table *f, wrcd_bogie_state *b, int s)
{
    const double speed_m_s = b->speed[s] / f->ticks;
    bool is_complete = false;

    if (!is_calm(f, b, s, speed_m_s))
        return end_block(f, b);
    if (b->block_stretches > 0 && fabs(speed_m_s / b->block_first_m_s - 1.0) >= f->alike)
        is_complete = end_block(f, b);
    add_to_block(f, b, s, speed_m_s);
    return is_complete || ((double)b->block_stretches >= f->most_stretches && end_block(f, b));
}

static void begin_stretch(const wrcd_fit_table *f, wrcd_bogie_state *b, int s, double speed_m_s)
{
    const double delay = round(f->wheelbase_m / (fmax(speed_m_s, f->least_speed_m_s) * f->tick_s));

    memset(b->sum[s], 0, sizeof b->sum[s]);
    memset(b->turning[s], 0, sizeof b->turning[s]);
    memset(b->high[s], 0, sizeof b->high[s]);
    memset(b->missing[s], 0, sizeof b->missing[s]);
    b->delay[s] = delay < (double)RING ? (int32_t)delay : 0;
    b->is_spoiled[s] = speed_m_s < f->least_speed_m_s || delay >= (double)RING || (double)b->ticks < delay;
    b->speed[s] = 0.0;
    b->slowest[s] = b->fastest[s] = speed_m_s;
}

static void gather(const wrcd_fit_table *f, wrcd_bogie_state *b, int s, int at, const double high[2], double speed_m_s)
{
    const double *leading = b->ring[(b->ticks - b->delay[s]) & (RING - 1)], w = 0.5 - 0.5 * f->cosine[at];
    const double windowed[SIGNALS] = {w * leading[0], w * leading[1], w * b->newest[2], w * b->newest[3]};
    const int n = f->ticks, step = f->bins_apart * at % n;

    for (int bin = 0, k = f->first_bin * at % n; bin < BINS; bin++, k = k + step < n ? k + step : k + step - n) {
        const int quarter = n / 4, behind = k >= quarter ? k - quarter : k - quarter + n;
        const double c = f->cosine[k], minus_sine = -f->cosine[behind];
        for (int i = 0; i < SIGNALS; i++) {
            b->sum[s][bin][0][i] += windowed[i] * c;
            b->sum[s][bin][1][i] += windowed[i] * minus_sine;
        }
    }
    for (int k = 0; k < 2; k++) {
        b->turning[s][at * QUARTERS / n][k] += b->newest[2 * k];
        b->high[s][k][MOST] = fmax(b->high[s][k][MOST], fabs(high[k]));
        b->high[s][k][MEAN] += fabs(high[k]);
    }
    b->speed[s] += speed_m_s;
    b->slowest[s] = fmin(b->slowest[s], speed_m_s);
    b->fastest[s] = fmax(b->fastest[s], speed_m_s);
    b->is_spoiled[s] = b->fastest[s] - b->slowest[s] > f->steady * b->fastest[s];
}

bool wrcd_calm_step(const wrcd_fit_table *f, wrcd_bogie_state *b, int64_t tick, const double z[SIGNALS],
                    const bool is_there[SIGNALS], double speed_m_s)
{
    const int n = f->ticks;
    bool is_complete = false;

    if (tick != b->newest_tick + 1 || b->ticks == 0) {
        is_complete = end_block(f, b);
        b->ticks = 0;
        memset(b->highpass, 0, sizeof b->highpass);
    }
    b->newest_tick = tick;
    for (int c = 0; c < SIGNALS; c++)
        b->newest[c] = is_there[c] ? z[c] : b->newest[c];
    double high[2] = {b->newest[1], b->newest[3]};
    wrcd_sections_step(f->highpass, 2, b->highpass, 2, high);
    memcpy(b->ring[b->ticks & (RING - 1)], b->newest, sizeof b->ring[0]);
    for (int s = 0; s < 2; s++) {
        const int64_t since = b->ticks - s * (n / 2);
        const int at = (int)(since % n);
        if (since < 0)
            continue;
        if (at == 0)
            begin_stretch(f, b, s, speed_m_s);
        for (int c = 0; c < SIGNALS; c++)
            b->missing[s][c] += !is_there[c];
        if (!b->is_spoiled[s])
            gather(f, b, s, at, high, speed_m_s);
        if (at == n - 1)
            is_complete = end_stretch(f, b, s) || is_complete;
    }
    b->ticks++;
    return is_complete;
}
