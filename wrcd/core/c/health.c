/* Whether gyro and accelerometer are the pair that they should be: one posterior over what may be wrong with them.
 *
 * What both say, how they go together, and how with the other axle of their bogie, becomes a vector of features. A small
 * network, fitted to simulated pairs of every kind and kept in the design, says how much likelier each state makes them than a
 * sound pair does: the rail is unknown to all states alike. */
#include "parts.h"

enum { STATES = WRCD_PAIR_STATES, ROWS = WRCD_PAIR_ROWS, OTHER_AXLE = 5 /* PairState's */ };
enum { POWER = 0, CROSS_POWER = 2 * BANDS, FINE = 3 * BANDS, VARIANCE = FINE + 2, OF_PARTNER = VARIANCE + 2,
       PARTNER = OF_PARTNER + 8 * BANDS, GIVEN = PARTNER + 2 * BANDS, APART = GIVEN + GIVEN_COLUMNS,
       OF_NOW = APART + 2 * BANDS };
_Static_assert((int)OF_NOW + 2 * (int)BANDS == (int)WRCD_PAIR_ROWS, "rows of a span");
static const double MIN_SHARE = 0.5; /* of a span's ticks that an axle must have data in */
static const double LEAST_RATIO = 0.003, MIN_SPEED_M_S = 1.0;
static const int SPANS[2] = {5, WRCD_PAIR_SPANS}; /* of the means, 1.2 and 6 s: what was loud before is gone then */

/* The newest span's means of an axle's pair, with its partner's where that counts. Rows: power [BANDS][2], cross [BANDS],
 * fine [2], variance [2], of partner [2][4][BANDS], partner's power [BANDS][2], what the rules were given but the
 * bands, own signals a wheelbase apart [2][BANDS], own and partner's signals of the same moment [2][BANDS]. */
static void rows_of(const double sums[SUMS], double their_ticks, const double inputs[WRCD_COLUMNS], double row[ROWS])
{
    const double ticks = greater(sums[BAND_N], 1.0), both = sqrt(ticks) * sqrt(greater(their_ticks, 1.0));

    for (int k = 0; k < 2 * BANDS; k++) {
        row[POWER + k] = sums[OWN_POWER + k] / ticks;
        row[PARTNER + k] = their_ticks > 0.0 ? sums[THEIR_POWER + k] / their_ticks : 0.0;
    }
    for (int k = 0; k < BANDS; k++)
        row[CROSS_POWER + k] = sums[OWN_CROSS + k] / ticks;
    for (int k = 0; k < 8 * BANDS; k++)
        row[OF_PARTNER + k] = their_ticks > 0.0 ? sums[SUM_ACROSS + k] / both : 0.0;
    for (int k = 0; k < 2 * BANDS; k++) {
        row[APART + k] = sums[OWN_APART + k] / ticks;
        row[OF_NOW + k] = their_ticks > 0.0 ? sums[SUM_NOW + k] / both : 0.0;
    }
    for (int c = 0; c < CHANNELS; c++) {
        const double mean = sums[PLAIN + c] / ticks;
        row[FINE + c] = sums[SUM_FINE + c] / ticks;
        row[VARIANCE + c] = sums[PLAIN + CHANNELS + c] / ticks - mean * mean;
    }
    for (int c = 0; c < GIVEN_COLUMNS; c++)
        row[GIVEN + c] = isfinite(inputs[c]) ? inputs[c] : 0.0;
}

/* Log powers, correlations, log powers of noise and of all. Returns where the next feature goes. */
static double *own_features(const double row[ROWS], double *x)
{
    double power[2 * BANDS];

    for (int k = 0; k < 2 * BANDS; k++) {
        power[k] = row[POWER + k] + BAND_FLOOR;
        *x++ = log10(power[k]);
    }
    for (int k = 0; k < BANDS; k++)
        *x++ = row[CROSS_POWER + k] / sqrt(power[2 * k + YAW] * power[2 * k + LAT]);
    for (int k = 0; k < 4; k++)
        *x++ = log10(greater(row[FINE + k], 0.0) + BAND_FLOOR);
    return x;
}

/* Correlations with the partner's signals; 0 where there is none. */
static double *partner_features(const double row[ROWS], double *x)
{
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < BANDS; k++) {
            const double mine = row[POWER + 2 * k + WRCD_ACROSS[i % 4][0]] + BAND_FLOOR;
            const double theirs = row[PARTNER + 2 * k + WRCD_ACROSS[i % 4][1]] + BAND_FLOOR;
            *x++ = row[OF_PARTNER + i * BANDS + k] / sqrt(mine * theirs);
        }
    return x;
}

/* Correlations that swapped wires, and in part late signals, give: own signals a wheelbase apart; own ones with the partner's
 * of the same moment, 0 where no partner counts. */
static double *wire_features(const double row[ROWS], double *x)
{
    for (int k = 0; k < 2 * BANDS; k++) {
        const double *power = row + POWER + 2 * (k % BANDS);
        *x++ = row[APART + k] / sqrt((power[YAW] + BAND_FLOOR) * (power[LAT] + BAND_FLOOR));
    }
    for (int k = 0; k < 2 * BANDS; k++) {
        const int own = k < BANDS ? YAW : LAT, of_band = 2 * (k % BANDS);
        const double mine = row[POWER + of_band + own] + BAND_FLOOR, theirs = row[PARTNER + of_band + 1 - own] + BAND_FLOOR;
        *x++ = row[OF_NOW + k] / sqrt(mine * theirs);
    }
    return x;
}

static double *copied(const double *from, double *x)
{
    memcpy(x, from, GIVEN_COLUMNS * sizeof *x);
    return x + GIVEN_COLUMNS;
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
    double mean[2][ROWS];

    x = own_features(a->health_rows[0], x);
    for (int s = 0; s < 2; s++) {
        mean_of(a, SPANS[s], mean[s]);
        x = own_features(mean[s], x);
        x = partner_features(mean[s], x);
        x = copied(mean[s] + GIVEN, x);
    }
    *x++ = log10(greater(speed_m_s, MIN_SPEED_M_S));
    *x++ = log10(greater(isfinite(ratio) ? ratio : 0.0, LEAST_RATIO));
    x = copied(a->health_rows[0] + GIVEN, x);
    for (int s = 0; s < 2; s++) /* last: a design of before lacks them */
        x = wire_features(mean[s], x);
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

bool wrcd_pair_sound(const wrcd_axle *a)
{
    double p[STATES];

    softmax(a->log_odds, p);
    return p[0] >= 0.5;
}

/* The state that leads beside a sound pair. */
static int lead_of(const wrcd_axle *a)
{
    int lead = 1;

    for (int k = 2; k < STATES; k++)
        lead = a->log_odds[k] > a->log_odds[lead] ? k : lead;
    return lead;
}

/* At a span's end: what the rules were given, and the torque of the moment, by axle. A partner counts that is sound, or whose
 * wires are swapped: then both are accused, and each one's evidence is in the other's signals. */
void wrcd_health_look(wrcd_estimator *e, const wrcd_design *d, const double inputs[][WRCD_COLUMNS], const double *ratio)
{
    const int axles = (int)e->axles;
    bool known[WRCD_MAX_AXLES] = {false}, counts[WRCD_MAX_AXLES] = {false};
    double sums[WRCD_MAX_AXLES][SUMS], x[WRCD_PAIR_FEATURES];

    for (int axle = 0; axle < axles && axle < WRCD_MAX_AXLES; axle++) { /* says twice how many, for gcc's -Wstringop-overflow */
        wrcd_window_sums(e, d, axle, 0, SPAN_TICKS / WRCD_BLOCK_TICKS, true, sums[axle]);
        known[axle] = sums[axle][BAND_N] >= MIN_SHARE * (double)SPAN_TICKS && e->axle[axle].pair_goes_on > 0.0;
        counts[axle] = known[axle] && (wrcd_pair_sound(&e->axle[axle]) || lead_of(&e->axle[axle]) == OTHER_AXLE);
    }
    for (int axle = 0; axle < axles; axle++) {
        wrcd_axle *a = &e->axle[axle];
        const int partner = (int)e->partner[axle];
        if (!known[axle])
            continue;
        memmove(a->health_rows[1], a->health_rows[0], (WRCD_PAIR_SPANS - 1) * sizeof a->health_rows[0]);
        const bool beside = partner >= 0 && counts[partner];
        rows_of(sums[axle], beside ? sums[partner][BAND_N] : 0.0, inputs[axle], a->health_rows[0]);
        a->health_held = lesser(a->health_held + 1.0, WRCD_PAIR_SPANS);
        wrcd_pair_features(a, e->speed_m_s, ratio[axle], x);
        update(d->health, x, a->log_odds);
    }
}

int wrcd_pair_state(const wrcd_estimator *e, int axle)
{
    return wrcd_pair_sound(&e->axle[axle]) ? 0 : lead_of(&e->axle[axle]);
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
        const double yaw = mean[POWER + 2 * k + YAW] + BAND_FLOOR, lat = mean[POWER + 2 * k + LAT] + BAND_FLOOR;
        figures[1 + k] = mean[CROSS_POWER + k] / sqrt(yaw * lat);
        figures[3 + k] = sqrt(greater(mean[VARIANCE + k], 0.0));
    }
}
