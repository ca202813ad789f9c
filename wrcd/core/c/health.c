/* Whether gyro and accelerometer are the pair that they should be: one posterior over what may be wrong with them.
 *
 * What both say, how they go together, and how with the other axle of their bogie, becomes a vector of features. A small
 * network, fitted to simulated pairs of every kind and kept in the design, says how much likelier each state makes them than a
 * sound pair does: the rail is unknown to all states alike. */
#include "parts.h"

enum { BANDS = WRCD_BANDS, OUTPUTS = WRCD_PAIR_OUTPUTS, STATES = WRCD_PAIR_STATES, ROWS = WRCD_PAIR_ROWS, PLACES = 4 };
static const double OFFSET_S = 2.0;        /* memory of the running mean that is taken off */
static const double MAX_NOISE_RATIO = 1e6; /* times the noise: what is further off does not count for more */

/* One tick of an axle's channel: white noise of power one leaves power one in each output. x: the states before, kept
 * where `used`. */
static void filter(const wrcd_design *d, double in, double x[WRCD_PAIR_FILTER][CHANNELS], int c, bool used,
                   double out[OUTPUTS])
{
    double *y4 = &out[BANDS];

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
    *y4 = (in - 4.0 * past[0] + 6.0 * past[CHANNELS] - 4.0 * past[2 * CHANNELS] + past[3 * CHANNELS]) / sqrt(70.0);
    if (used) {
        for (int k = 3; k > 0; k--)
            past[k * CHANNELS] = past[(k - 1) * CHANNELS];
        past[0] = in;
    }
}

static double *ring_of(wrcd_estimator *e, const wrcd_design *d, int bogie, int at)
{
    const ptrdiff_t length = d->longest_wheelbase_ticks + 1, before = (ptrdiff_t)e->axles * 2 * d->longest * WRCD_SUMS;

    return e->rest + before + (bogie * length + at) * BANDS * PLACES;
}

/* One tick of an axle's raw measurements; their running mean is taken off. */
void wrcd_pair_step(wrcd_estimator *e, const wrcd_design *d, int axle, const double z[CHANNELS], bool used)
{
    wrcd_axle *a = &e->axle[axle];
    double *now = ring_of(e, d, axle / 2, (int)e->pair_at);

    if (used)
        a->pair_offset_ticks = lesser(a->pair_offset_ticks + 1.0, OFFSET_S / d->tick_s);
    for (int c = 0; c < CHANNELS; c++) {
        double x = used ? held(z[c] / d->noise_rms[c], -MAX_NOISE_RATIO, MAX_NOISE_RATIO) : 0.0, y[OUTPUTS];
        if (used)
            a->pair_mean[c] += (x - a->pair_mean[c]) / greater(a->pair_offset_ticks, 1.0);
        x -= a->pair_mean[c];
        filter(d, x, a->pair_filter, c, used, y);
        for (int k = 0; k < BANDS; k++)
            now[k * PLACES + 2 * c + axle % 2] = used ? y[k] : 0.0;
        if (used) {
            a->pair_plain[0][c] += y[BANDS] * y[BANDS];
            a->pair_plain[1][c] += x;
            a->pair_plain[2][c] += x * x;
        }
    }
    a->pair_ticks += used ? 1.0 : 0.0;
    a->pair_goes_on = used ? 1.0 : 0.0;
}

/* Products of any two signals of a bogie: together, and apart, the second a wheelbase ago. */
void wrcd_pair_end_of_tick(wrcd_estimator *e, const wrcd_design *d)
{
    const int length = d->longest_wheelbase_ticks + 1, at = (int)e->pair_at;
    const int then = ((at - (int)e->pair_later) % length + length) % length;

    for (int bogie = 0; bogie < ((int)e->axles + 1) / 2; bogie++) {
        const double *now = ring_of(e, d, bogie, at), *before = ring_of(e, d, bogie, then);
        for (int k = 0; k < BANDS; k++)
            for (int i = 0; i < PLACES; i++)
                for (int j = 0; j < PLACES; j++) {
                    e->pair_products[bogie][0][k][i][j] += now[k * PLACES + i] * now[k * PLACES + j];
                    e->pair_products[bogie][1][k][i][j] += now[k * PLACES + i] * before[k * PLACES + j];
                }
    }
    e->pair_at = (at + 1) % length;
}

/* Start an axle's filters and its span anew; what was found out before stays. */
void wrcd_pair_reset(wrcd_estimator *e, const wrcd_design *d, int axle)
{
    wrcd_axle *a = &e->axle[axle];
    const int bogie = axle / 2, place = axle % 2;
    bool any = false;

    memset(a->pair_filter, 0, sizeof a->pair_filter);
    memset(a->pair_mean, 0, sizeof a->pair_mean);
    memset(a->pair_plain, 0, sizeof a->pair_plain);
    a->pair_offset_ticks = a->pair_ticks = a->pair_goes_on = 0.0;
    for (int k = 0; k < 2 * BANDS; k++)
        for (int i = 0; i < PLACES; i++)
            for (int j = 0; j < PLACES; j++)
                if (i % 2 == place || j % 2 == place)
                    e->pair_products[bogie][k / BANDS][k % BANDS][i][j] = 0.0;
    for (int k = 0; k <= d->longest_wheelbase_ticks; k++)
        for (int i = 0; i < BANDS * PLACES; i++)
            if (i % 2 == place)
                ring_of(e, d, bogie, k)[i] = 0.0;
    for (int other = 0; other < (int)e->axles; other++)
        any = any || e->axle[other].pair_offset_ticks > 0.0;
    if (!any) {
        e->pair_at = 0.0;
        e->pair_later = d->longest_wheelbase_ticks;
    }
}

enum { POWER = 0, CROSS_POWER = 2 * BANDS, FINE = 3 * BANDS, VARIANCE = FINE + 2, OF_PARTNER = VARIANCE + 2,
       PARTNER = OF_PARTNER + 8 * BANDS, GIVEN = PARTNER + 2 * BANDS };
static const double MIN_SHARE = 0.5; /* of a span's ticks that an axle must have data in */
static const double FLOOR = 0.02;    /* of the noise's power */
static const double LEAST_RATIO = 0.003, MIN_SPEED_M_S = 1.0;
static const int ACROSS[4][2] = {{YAW, YAW}, {LAT, LAT}, {YAW, LAT}, {LAT, YAW}}; /* own signal, partner's */
static const int SPANS[2] = {5, WRCD_PAIR_SPANS}; /* of the means, 1.2 and 6 s: what was loud before is gone then */

/* The newest span's means of an axle's pair, with its partner's where that counts. Rows: power [BANDS][2], cross [BANDS],
 * fine [2], variance [2], of partner [2][4][BANDS], partner's power [BANDS][2], what the rules were given. */
static void rows_of(const wrcd_estimator *e, int axle, bool partner, const double inputs[WRCD_COLUMNS], double row[ROWS])
{
    const wrcd_axle *a = &e->axle[axle];
    const int own = axle % 2, their = 1 - own;
    double per[PLACES];

    for (int i = 0; i < PLACES; i++) {
        const int other = axle - own + i % 2;
        per[i] = greater(sqrt(other < (int)e->axles ? greater(e->axle[other].pair_ticks, 1.0) : 0.0), 1.0);
    }
#define MEAN(which, k, i, j) (e->pair_products[axle / 2][which][k][i][j] / (per[i] * per[j]))
    for (int k = 0; k < BANDS; k++) {
        for (int c = 0; c < CHANNELS; c++) {
            row[POWER + 2 * k + c] = MEAN(0, k, 2 * c + own, 2 * c + own);
            row[PARTNER + 2 * k + c] = partner ? MEAN(0, k, 2 * c + their, 2 * c + their) : 0.0;
        }
        row[CROSS_POWER + k] = MEAN(0, k, 2 * YAW + own, 2 * LAT + own);
        for (int i = 0; i < 4; i++) {
            const int mine = 2 * ACROSS[i][0] + own, theirs = 2 * ACROSS[i][1] + their;
            row[OF_PARTNER + i * BANDS + k] = partner ? MEAN(1, k, mine, theirs) : 0.0;
            row[OF_PARTNER + (4 + i) * BANDS + k] = partner ? MEAN(1, k, theirs, mine) : 0.0;
        }
    }
#undef MEAN
    for (int c = 0; c < CHANNELS; c++) {
        const double ticks = greater(a->pair_ticks, 1.0), mean = a->pair_plain[1][c] / ticks;
        row[FINE + c] = a->pair_plain[0][c] / ticks;
        row[VARIANCE + c] = a->pair_plain[2][c] / ticks - mean * mean;
    }
    for (int c = 0; c < WRCD_COLUMNS; c++)
        row[GIVEN + c] = isfinite(inputs[c]) ? inputs[c] : 0.0;
}

/* Log powers, correlations, log powers of noise and of all. Returns where the next feature goes. */
static double *own_features(const double row[ROWS], double *x)
{
    double power[2 * BANDS];

    for (int k = 0; k < 2 * BANDS; k++) {
        power[k] = row[POWER + k] + FLOOR;
        *x++ = log10(power[k]);
    }
    for (int k = 0; k < BANDS; k++)
        *x++ = row[CROSS_POWER + k] / sqrt(power[2 * k + YAW] * power[2 * k + LAT]);
    for (int k = 0; k < 4; k++)
        *x++ = log10(greater(row[FINE + k], 0.0) + FLOOR);
    return x;
}

/* Correlations with the partner's signals; 0 where there is none. */
static double *partner_features(const double row[ROWS], double *x)
{
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < BANDS; k++) {
            const double mine = row[POWER + 2 * k + ACROSS[i % 4][0]] + FLOOR;
            const double theirs = row[PARTNER + 2 * k + ACROSS[i % 4][1]] + FLOOR;
            *x++ = row[OF_PARTNER + i * BANDS + k] / sqrt(mine * theirs);
        }
    return x;
}

static double *copied(const double *from, double *x)
{
    memcpy(x, from, WRCD_COLUMNS * sizeof *x);
    return x + WRCD_COLUMNS;
}

/* Over the newest spans, or those that there are. */
static void mean_of(const wrcd_axle *a, int spans, double mean[ROWS])
{
    memset(mean, 0, ROWS * sizeof *mean);
    for (int k = 0; k < spans; k++)
        for (int r = 0; r < ROWS; r++)
            mean[r] += a->health_rows[k][r];
    for (int r = 0; r < ROWS; r++)
        mean[r] /= greater(lesser(a->health_held, spans), 1.0);
}

void wrcd_pair_features(const wrcd_axle *a, double speed_m_s, double ratio, double x[WRCD_PAIR_FEATURES])
{
    x = own_features(a->health_rows[0], x);
    for (int s = 0; s < 2; s++) {
        double mean[ROWS];
        mean_of(a, SPANS[s], mean);
        x = own_features(mean, x);
        x = partner_features(mean, x);
        x = copied(mean + GIVEN, x);
    }
    *x++ = log10(greater(speed_m_s, MIN_SPEED_M_S));
    *x++ = log10(greater(isfinite(ratio) ? ratio : 0.0, LEAST_RATIO));
    (void)copied(a->health_rows[0] + GIVEN, x);
}

static void softmax(const double log_odds[STATES], double p[STATES])
{
    double most = log_odds[0], sum = 0.0;

    for (int k = 1; k < STATES; k++)
        most = greater(most, log_odds[k]);
    for (int k = 0; k < STATES; k++)
        sum += p[k] = exp(log_odds[k] - most);
    for (int k = 0; k < STATES; k++)
        p[k] /= sum;
}

/* Log of how much likelier features are in each state than of a sound pair. */
void wrcd_health_evidence(const wrcd_health_table *h, const double x[WRCD_PAIR_FEATURES], double evidence[STATES])
{
    _Static_assert(WRCD_PAIR_FEATURES % 2 == 0, "two at once");
    const int n = h->hidden_units;
    double unit[WRCD_MAX_HIDDEN], z[WRCD_PAIR_FEATURES];

    memcpy(unit, h->hidden_bias, (size_t)n * sizeof *unit);
    for (int f = 0; f < WRCD_PAIR_FEATURES; f++)
        z[f] = held((x[f] - h->middle[f]) / h->scale[f], -MAX_FEATURE, MAX_FEATURE);
    for (int f = 0; f < WRCD_PAIR_FEATURES; f += 2) { /* an even number: half the ways to memory and back */
        const double *weights = h->hidden + f * n;
        for (int k = 0; k < n; k++)
            unit[k] = unit[k] + z[f] * weights[k] + z[f + 1] * weights[n + k];
    }
    memcpy(evidence, h->out_bias, STATES * sizeof *evidence);
    for (int k = 0; k < h->hidden_units; k++) {
        const double says = tanh(unit[k]);
        for (int s = 0; s < STATES; s++)
            evidence[s] += says * h->out[k * STATES + s];
    }
    for (int s = STATES - 1; s >= 0; s--)
        evidence[s] -= evidence[0];
}

/* The log odds of a pair's states a span later: they forget slowly, allow for a sensor that breaks, and take up the span's
 * evidence, tempered, since what misleads in one span misleads in the next. */
static void update(const wrcd_health_table *h, const double x[WRCD_PAIR_FEATURES], double log_odds[STATES])
{
    double evidence[STATES], p[STATES], prior[STATES], faded[STATES];

    wrcd_health_evidence(h, x, evidence);
    for (int s = 0; s < STATES; s++)
        faded[s] = h->log_prior[s] + h->kept * (log_odds[s] - h->log_prior[s]);
    softmax(faded, p);
    softmax(h->log_prior, prior);
    for (int s = 0; s < STATES; s++)
        p[s] = (1.0 - h->hazard) * p[s] + h->hazard * prior[s];
    for (int s = 0; s < STATES; s++) {
        const double odds = held(log(p[s] / p[0]) + h->temper[s] * evidence[s], -CERTAIN, CERTAIN);
        log_odds[s] = isfinite(odds) ? odds : log_odds[s];
    }
}

static bool likely_sound(const wrcd_axle *a)
{
    double p[STATES];

    softmax(a->log_odds, p);
    return p[0] >= 0.5;
}

/* At a span's end: what the rules were given, and the torque of the moment, by axle. */
void wrcd_health_look(wrcd_estimator *e, const wrcd_design *d, const double inputs[][WRCD_COLUMNS], const double *ratio)
{
    const int axles = (int)e->axles;
    bool known[WRCD_MAX_AXLES] = {false}, sound[WRCD_MAX_AXLES] = {false};
    double x[WRCD_PAIR_FEATURES];

    for (int axle = 0; axle < axles; axle++) {
        const wrcd_axle *a = &e->axle[axle];
        known[axle] = a->pair_ticks >= MIN_SHARE * (double)SPAN_TICKS && a->pair_goes_on > 0.0;
        sound[axle] = likely_sound(a);
    }
    for (int axle = 0; axle < axles; axle++) {
        wrcd_axle *a = &e->axle[axle];
        const int partner = axle ^ 1;
        if (!known[axle])
            continue;
        memmove(a->health_rows[1], a->health_rows[0], (WRCD_PAIR_SPANS - 1) * sizeof a->health_rows[0]);
        rows_of(e, axle, partner < axles && known[partner] && sound[partner], inputs[axle], a->health_rows[0]);
        a->health_held = lesser(a->health_held + 1.0, WRCD_PAIR_SPANS);
        wrcd_pair_features(a, e->speed_m_s, ratio[axle], x);
        update(d->health, x, a->log_odds);
    }
    for (int axle = 0; axle < axles; axle++) {
        memset(e->axle[axle].pair_plain, 0, sizeof e->axle[axle].pair_plain);
        e->axle[axle].pair_ticks = 0.0;
    }
    memset(e->pair_products, 0, sizeof e->pair_products);
    const double speed = isfinite(e->speed_m_s) ? greater(fabs(e->speed_m_s), SLOWEST_M_S) : SLOWEST_M_S;
    const double wheelbase = nearbyint(d->wheelbase_m / d->tick_s / speed);
    e->pair_later = lesser(wheelbase, d->longest_wheelbase_ticks);
}

/* The state that leads beside a sound pair. */
static int lead_of(const wrcd_axle *a)
{
    int lead = 1;

    for (int k = 2; k < STATES; k++)
        lead = a->log_odds[k] > a->log_odds[lead] ? k : lead;
    return lead;
}

int wrcd_pair_state(const wrcd_estimator *e, int axle)
{
    return likely_sound(&e->axle[axle]) ? 0 : lead_of(&e->axle[axle]);
}

/* For a person: of an axle the states' probabilities, and what they were found by: the state that leads beside a sound pair,
 * correlations below 1.5 Hz and in 3 to 10 Hz, each signal's alternating part in units of the design's sensor noise. */
void wrcd_health_figures(const wrcd_estimator *e, int axle, double p[STATES], double figures[5])
{
    const wrcd_axle *a = &e->axle[axle];
    double mean[ROWS];

    softmax(a->log_odds, p);
    mean_of(a, WRCD_PAIR_SPANS, mean);
    figures[0] = lead_of(a);
    for (int k = 0; k < 2; k++) {
        const double yaw = mean[POWER + 2 * k + YAW] + FLOOR, lat = mean[POWER + 2 * k + LAT] + FLOOR;
        figures[1 + k] = mean[CROSS_POWER + k] / sqrt(yaw * lat);
        figures[3 + k] = sqrt(greater(mean[VARIANCE + k], 0.0));
    }
}
