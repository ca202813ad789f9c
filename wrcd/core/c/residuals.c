/* Running sums of the innovations: those of any window are the difference of two rows.
 *
 * The sums count from the start of a generation, `longest` blocks long; when one is over, its rows are taken back by its
 * end. So the contents follow from the ticks' numbers and from what the last two generations brought.
 */
#include "parts.h"

static const double SMALLEST = 1e-12; /* a power this far below what the model expects is as good as zero */

static ptrdiff_t row_at(const wrcd_design *d, int axle, int row)
{
    return ((ptrdiff_t)axle * 2 * d->longest + row) * SUMS;
}

static int end_row(const wrcd_estimator *e, const wrcd_design *d)
{
    const int64_t newest = (int64_t)e->window_newest; /* -1 before the first */

    return d->longest + (int)((newest + d->longest) % d->longest);
}

static void next_generation(double *rows, int longest)
{
    const double span = longest * WRCD_BLOCK_TICKS;
    const double *end = rows + (2 * longest - 1) * SUMS;

    for (int k = 0; k < longest; k++) {
        double *to = rows + k * SUMS;
        const double *from = rows + (longest + k) * SUMS;
        for (int c = 0; c < SUMS; c++)
            to[c] = k == longest - 1 ? 0.0 : from[c] - end[c];
        if (k < longest - 1) {
            to[TT] += span * (span * to[N] - 2.0 * to[T]);
            to[T] -= span * to[N];
            for (int c = 0; c < W; c++)
                to[SUM_TW + c] -= span * to[SUM_W + c];
        }
    }
}

/* Begin a block, if it is not the newest: its row is what the one before it came to. */
void wrcd_window_move(wrcd_estimator *e, const wrcd_design *d, int64_t block)
{
    const int axles = (int)e->axles, longest = d->longest;
    int64_t newest = (int64_t)e->window_newest;

    if (block == newest)
        return;
    if (block - newest > 2 * longest) {
        memset(e->rest, 0, (size_t)axles * 2U * (size_t)longest * SUMS * sizeof(double));
        newest = block - 1;
    }
    for (int64_t passed = newest + 1; passed <= block; passed++) {
        const int at = longest + (int)(passed % longest);
        for (int axle = 0; axle < axles; axle++) {
            if (passed % longest == 0)
                next_generation(e->rest + row_at(d, axle, 0), longest);
            memcpy(e->rest + row_at(d, axle, at), e->rest + row_at(d, axle, at - 1), SUMS * sizeof(double));
        }
    }
    e->window_newest = (double)block;
}

/* Add a tick of the newest block: innovations filtered and unfiltered, whether the axle runs, and whether the tick had
 * data, lies far from a pulse (live), and far from any that still swings (calm). */
void wrcd_window_put(wrcd_estimator *e, const wrcd_design *d, int axle, int64_t tick, const double w[W], const double raw[W],
                window_tick is)
{
    static const double nothing[W] = {0.0};
    wrcd_axle *a = &e->axle[axle];
    const double block = e->window_newest, one = 1.0;
    const double t = (double)(tick % WRCD_BLOCK_TICKS + WRCD_BLOCK_TICKS * ((int64_t)block % d->longest));

    if (is.running) {
        double *row = e->rest + row_at(d, axle, end_row(e, d));
        if (a->window_last < block - 1.0)
            a->window_first = block;
        a->window_last = block;
        row[N] += one;
        row[HEARD] += is.heard ? one : 0.0;
        row[LIVE] += is.live ? one : 0.0;
        row[T] += t;
        row[TT] += t * t;
        for (int c = 0; c < W; c++) {
            row[SUM_W + c] += w[c];
            row[SUM_TW + c] += w[c] * t;
            row[SUM_WW + c] += w[c] * w[c];
            row[SUM_LAG + c] += w[c] * a->window_past[0][c];
        }
        for (int k = 0; k < MODELS; k++)
            row[SUM_CROSS + k] += w[CHANNELS * k] * w[CHANNELS * k + 1];
        if (isfinite(is.ratio)) {
            row[RATIO] += is.ratio;
            row[RATIO_N] += one;
        }
        if (is.calm) {
            row[RAW_N] += one;
            for (int c = 0; c < W; c++) {
                row[SUM_RAW + c] += raw[c];
                row[SUM_RAW2 + c] += raw[c] * raw[c];
            }
        }
    }
    memmove(a->window_past[0], a->window_past[1], (WRCD_LAG - 1) * sizeof a->window_past[0]);
    memcpy(a->window_past[WRCD_LAG - 1], is.running ? w : nothing, sizeof a->window_past[0]);
}

double *wrcd_window_row(wrcd_estimator *e, const wrcd_design *d, int axle, int row) { return e->rest + row_at(d, axle, row); }

double *wrcd_window_newest(wrcd_estimator *e, const wrcd_design *d, int axle)
{
    return wrcd_window_row(e, d, axle, end_row(e, d));
}

void wrcd_window_reset(wrcd_estimator *e, const wrcd_design *d, int axle)
{
    wrcd_axle *a = &e->axle[axle];

    memset(e->rest + row_at(d, axle, 0), 0, 2U * (size_t)d->longest * SUMS * sizeof(double));
    memset(a->window_past, 0, sizeof a->window_past);
    a->window_since = a->window_first = 0.0;
    a->window_last = -2.0;
}

/* Drop what is older than the newest blocks. */
void wrcd_window_truncate(wrcd_estimator *e, int axle, int blocks)
{
    wrcd_axle *a = &e->axle[axle];

    a->window_since = greater(a->window_since, e->window_newest - blocks + 1.0);
}

/* How many of the newest blocks hold ticks without a gap. */
int wrcd_window_filled(const wrcd_estimator *e, const wrcd_design *d, int axle)
{
    const wrcd_axle *a = &e->axle[axle];
    const double whole = e->window_newest - greater(a->window_first, a->window_since) + 1.0;

    return a->window_last == e->window_newest ? (int)held(whole, 0.0, d->longest) : 0;
}

void wrcd_window_sums(const wrcd_estimator *e, const wrcd_design *d, int axle, int first, int end, bool past_change,
                 double sums[SUMS])
{
    const double since = greater(e->window_newest - e->axle[axle].window_since + 1.0, 0.0);
    const int most = past_change || since > d->longest ? d->longest : (int)since, newest = end_row(e, d);
    const double *newer = e->rest + row_at(d, axle, newest - (first < most ? first : most));
    const double *older = e->rest + row_at(d, axle, newest - (end < most ? end : most));

    for (int c = 0; c < SUMS; c++)
        sums[c] = newer[c] - older[c];
}

/* Torque ratio of the moment; NaN where it is not known. */
double wrcd_window_torque_now(const wrcd_estimator *e, const wrcd_design *d, int axle)
{
    double sums[SUMS];

    wrcd_window_sums(e, d, axle, 0, d->now, false, sums);
    return torque_of(sums);
}

/* The lowest and the highest torque ratio of any of the newest blocks, those before a change included. */
void wrcd_window_torque_range(const wrcd_estimator *e, const wrcd_design *d, int axle, int blocks, double range[2])
{
    const double *row = e->rest + row_at(d, axle, end_row(e, d) - blocks);

    range[0] = INFINITY;
    range[1] = -INFINITY;
    for (int k = 0; k < blocks; k++, row += SUMS) {
        const double mean = (row[SUMS + RATIO] - row[RATIO]) / (row[SUMS + RATIO_N] - row[RATIO_N]);
        range[0] = fmin(range[0], mean);
        range[1] = fmax(range[1], mean);
    }
}

/* Statistics of a window: RMS of the normalised residuals of Fig. 2, about a straight line, which is a sensor's bias and
 * what a filter has still to learn of it. Of live ticks; the others count as zeros in the sums. */
void wrcd_window_statistics_of(const double sums[SUMS], double min_ticks, window_statistics *s)
{
    const double n = sums[N], live = sums[LIVE], per_tick = 1.0 / n, mean_t = sums[T] * per_tick;
    const double per_spread = per_tick / greater(sums[TT] - sums[T] * mean_t, 1e-9);
    double mean[W], slope[W], power[W];

    for (int c = 0; c < W; c++) {
        mean[c] = sums[SUM_W + c] * per_tick;
        slope[c] = sums[SUM_TW + c] - mean_t * sums[SUM_W + c];
        const double line = mean[c] * mean[c] + slope[c] * slope[c] * per_spread;
        power[c] = greater(sums[SUM_WW + c] * per_tick - line, SMALLEST);
        s->lag[c] = held((sums[SUM_LAG + c] * per_tick - line) / power[c], -1.0, 1.0);
    }
    for (int k = 0, c = 0; k < MODELS; k++, c += CHANNELS) {
        const double together = mean[c] * mean[c + 1] + slope[c] * slope[c + 1] * per_spread;
        const double cross = (sums[SUM_CROSS + k] * per_tick - together) / sqrt(power[c] * power[c + 1]);
        s->cross[k] = held(cross, -1.0, 1.0);
        s->mean_square[k] = live < min_ticks ? NAN : 0.5 * (power[c] * (n / live) + power[c + 1] * (n / live));
    }
    s->ratio = sums[RATIO] / sums[RATIO_N];
    s->ticks = n;
    s->heard_share = sums[HEARD] / greater(n, 1.0);
    s->live_share = live / greater(n, 1.0);
}

static double raw_power(const double sums[SUMS], int model, double min_ticks)
{
    const double per_tick = 1.0 / sums[RAW_N];
    double power[CHANNELS];

    for (int c = 0; c < CHANNELS; c++) {
        const double mean = sums[SUM_RAW + CHANNELS * model + c] * per_tick;
        power[c] = greater(sums[SUM_RAW2 + CHANNELS * model + c] * per_tick - mean * mean, SMALLEST);
    }
    return sums[RAW_N] < min_ticks ? NAN : 0.5 * (power[0] + power[1]);
}

/* Decades between the unfiltered residuals of two parts of a window; NaN where either holds too little. */
void wrcd_window_decades(const double newer[SUMS], const double rest[SUMS], double min_ticks, double decades[MODELS])
{
    for (int k = 0; k < MODELS; k++)
        decades[k] = 0.5 * log10(raw_power(newer, k, min_ticks) / raw_power(rest, k, min_ticks));
}
