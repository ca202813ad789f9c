/* What a bogie's signals are in three bands: powers and products, summed up by blocks as the innovations are, for the
 * rules' windows and for the judgement of pairs of sensors. */
#include "parts.h"

enum { OUTPUTS = BANDS + 1 };
static const double OFFSET_S = 2.0;        /* memory of the running mean that is taken off */
static const double MAX_NOISE_RATIO = 1e6; /* times the noise: what is further off does not count for more */
const int WRCD_ACROSS[4][2] = {{YAW, YAW}, {LAT, LAT}, {YAW, LAT}, {LAT, YAW}};

/* One tick of an axle's channel: white noise of power one leaves power one in each output, the bands and the fourth
 * difference. x: the states before, kept where `used`. */
static void filter(const wrcd_design *d, double in, double x[WRCD_PAIR_FILTER][CHANNELS], int c, bool used,
                   double out[OUTPUTS])
{
    for (int k = 0; k < BANDS; k++) {
        const double *f = d->bands + 6 * k;
        const double first = x[k][c], second = x[BANDS + k][c], y = f[0] * in + first;
        if (used) {
            x[k][c] = f[1] * in - f[4] * y + second;
            x[BANDS + k][c] = f[2] * in - f[5] * y;
        }
        out[k] = y / sqrt(f[0]);
    }
    double *past = &x[2 * BANDS][c];
    out[BANDS] = (in - 4.0 * past[0] + 6.0 * past[CHANNELS] - 4.0 * past[2 * CHANNELS] + past[3 * CHANNELS]) / sqrt(70.0);
    if (used) {
        for (int k = 3; k > 0; k--)
            past[k * CHANNELS] = past[(k - 1) * CHANNELS];
        past[0] = in;
    }
}

static double *ring_of(wrcd_estimator *e, const wrcd_design *d, int axle, int at)
{
    const ptrdiff_t length = d->longest_wheelbase_ticks + 1, before = (ptrdiff_t)e->axles * 2 * d->longest * WRCD_SUMS;

    return e->rest + before + (axle * length + at) * BANDS * CHANNELS;
}

/* One tick of an axle's raw measurements; their running mean is taken off. */
void wrcd_bands_step(wrcd_estimator *e, const wrcd_design *d, int axle, const double z[CHANNELS], bool used)
{
    wrcd_axle *a = &e->axle[axle];
    double *now = ring_of(e, d, axle, (int)e->pair_at), *row = wrcd_window_newest(e, d, axle);

    if (used)
        a->pair_offset_ticks = lesser(a->pair_offset_ticks + 1.0, OFFSET_S / d->tick_s);
    for (int c = 0; c < CHANNELS; c++) {
        double x = used ? held(z[c] / d->noise_rms[c], -MAX_NOISE_RATIO, MAX_NOISE_RATIO) : 0.0, y[OUTPUTS];
        if (used)
            a->pair_mean[c] += (x - a->pair_mean[c]) / greater(a->pair_offset_ticks, 1.0);
        x -= a->pair_mean[c];
        filter(d, x, a->pair_filter, c, used, y);
        for (int k = 0; k < BANDS; k++)
            now[k * CHANNELS + c] = used ? y[k] : 0.0;
        if (used) {
            row[SUM_FINE + c] += y[BANDS] * y[BANDS];
            row[PLAIN + c] += x;
            row[PLAIN + CHANNELS + c] += x * x;
        }
    }
    row[BAND_N] += used ? 1.0 : 0.0;
    a->pair_goes_on = used ? 1.0 : 0.0;
}

/* An axle's powers and products; of the two signals also with one of them of a wheelbase ago. */
static void sum_own(double *row, const double *now, const double *then)
{
    for (int k = 0; k < BANDS; k++, now += CHANNELS, then += CHANNELS) {
        for (int c = 0; c < CHANNELS; c++)
            row[OWN_POWER + 2 * k + c] += now[c] * now[c];
        row[OWN_CROSS + k] += now[YAW] * now[LAT];
        row[OWN_APART + k] += now[YAW] * then[LAT];
        row[OWN_APART + BANDS + k] += then[YAW] * now[LAT];
    }
}

/* An axle's products with its partner: the partner's signals, then its own, are of a wheelbase ago. And products of the same
 * moment, of signals that swapped wires make a pair. */
static void sum_across(double *row, const double *mine, const double *mine_then, const double *theirs, const double *theirs_then)
{
    for (int k = 0; k < BANDS; k++) {
        const int at = k * CHANNELS;
        for (int c = 0; c < CHANNELS; c++)
            row[THEIR_POWER + 2 * k + c] += theirs[at + c] * theirs[at + c];
        for (int i = 0; i < 4; i++) {
            const int own = at + WRCD_ACROSS[i][0], other = at + WRCD_ACROSS[i][1];
            row[SUM_ACROSS + i * BANDS + k] += mine[own] * theirs_then[other];
            row[SUM_ACROSS + (4 + i) * BANDS + k] += theirs[other] * mine_then[own];
        }
        row[SUM_NOW + k] += mine[at + YAW] * theirs[at + LAT];
        row[SUM_NOW + BANDS + k] += mine[at + LAT] * theirs[at + YAW];
    }
}

/* How many ticks ago a wheelset's partner was where it is. */
static int wheelbase_ticks(const wrcd_estimator *e, const wrcd_design *d)
{
    const double speed = isfinite(e->speed_m_s) ? greater(fabs(e->speed_m_s), SLOWEST_M_S) : SLOWEST_M_S;

    return (int)lesser(nearbyint(d->wheelbase_m / d->tick_s / speed), d->longest_wheelbase_ticks);
}

void wrcd_bands_end_of_tick(wrcd_estimator *e, const wrcd_design *d)
{
    const int length = d->longest_wheelbase_ticks + 1, at = (int)e->pair_at;
    const int then = (at - wheelbase_ticks(e, d) + length) % length;

    for (int axle = 0; axle < (int)e->axles; axle++) {
        const int other = (int)e->partner[axle];
        double *row = wrcd_window_newest(e, d, axle), *now = ring_of(e, d, axle, at), *before = ring_of(e, d, axle, then);
        sum_own(row, now, before);
        if (other >= 0)
            sum_across(row, now, before, ring_of(e, d, other, at), ring_of(e, d, other, then));
    }
    e->pair_at = (at + 1) % length;
}

/* Start an axle's filters anew; what its partner has of it is forgotten. */
void wrcd_bands_reset(wrcd_estimator *e, const wrcd_design *d, int axle)
{
    wrcd_axle *a = &e->axle[axle];
    const int partner = (int)e->partner[axle];
    bool any = false;

    memset(a->pair_filter, 0, sizeof a->pair_filter);
    memset(a->pair_mean, 0, sizeof a->pair_mean);
    a->pair_offset_ticks = a->pair_goes_on = 0.0;
    for (int k = 0; partner >= 0 && k < 2 * d->longest; k++)
        memset(wrcd_window_row(e, d, partner, k) + THEIR_POWER, 0, (SUMS - THEIR_POWER) * sizeof(double));
    memset(ring_of(e, d, axle, 0), 0, ((size_t)d->longest_wheelbase_ticks + 1) * BANDS * CHANNELS * sizeof(double));
    for (int other = 0; other < (int)e->axles; other++)
        any = any || e->axle[other].pair_offset_ticks > 0.0;
    if (!any)
        e->pair_at = 0.0;
}

/* Of sums over a window: log powers of own signals, their correlation, and correlations with the partner's signals, both ways
 * round; 0 where that does not count. */
void wrcd_bands_columns(const double sums[SUMS], bool partner_counts, double x[BAND_COLUMNS])
{
    const double floor = BAND_FLOOR * greater(sums[BAND_N], 1.0);
    double own[2 * BANDS], their[2 * BANDS];

    for (int k = 0; k < 2 * BANDS; k++) {
        own[k] = sums[OWN_POWER + k] + floor;
        their[k] = sums[THEIR_POWER + k] + floor;
        *x++ = log10(own[k] / greater(sums[BAND_N], 1.0));
    }
    for (int k = 0; k < BANDS; k++)
        *x++ = held(sums[OWN_CROSS + k] / sqrt(own[2 * k + YAW] * own[2 * k + LAT]), -1.0, 1.0);
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < BANDS; k++) {
            const double both = own[2 * k + WRCD_ACROSS[i % 4][0]] * their[2 * k + WRCD_ACROSS[i % 4][1]];
            *x++ = partner_counts ? held(sums[SUM_ACROSS + i * BANDS + k] / sqrt(both), -1.0, 1.0) : 0.0;
        }
}
