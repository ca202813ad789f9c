/* The bank: four Kalman filters with steady-state gains for every axle, Fig. 2 with (13) to (15). */
#include "parts.h"

static const double MEMORY_S = 0.3; /* time constant: long against a cycle of the speed signal, short against a braking */
static const double RATE_AFTER_TICKS = 20.0; /* before, the rate of change is not known from the noise */
static const double MAX_ERROR_M_S = 1.5; /* a signal further away than this is another one: start with it */
enum { PACKAGED_STATES = 7 }; /* of the multiple unit's design */
static const double SPEED_STEP = 0.1;    /* m/s: matrices are made at multiples of this, and are linear between them */

/* An alpha-beta filter: the speed and its rate, so that a steady acceleration leaves no lag. */
double wrcd_speed_step(wrcd_estimator *e, const wrcd_design *d, double speed_m_s)
{
    const double alpha = 1.0 - exp(-d->tick_s / MEMORY_S), beta = 0.5 * alpha * alpha;
    const double most = greater(RATE_AFTER_TICKS + 1.0, ceil(1.0 / alpha));

    if (!isfinite(speed_m_s)) {
        e->speed = NAN;
        e->speed_rate = e->speed_ticks = 0.0;
        return NAN;
    }
    if (e->speed_ticks == 0.0 || fabs(speed_m_s - e->speed) > MAX_ERROR_M_S) {
        e->speed = speed_m_s;
        e->speed_rate = 0.0;
        e->speed_ticks = 1.0;
        return speed_m_s;
    }
    const double predicted = e->speed + e->speed_rate, error = speed_m_s - predicted;
    e->speed_ticks = lesser(e->speed_ticks + 1.0, most);
    e->speed = predicted + greater(alpha, 1.0 / e->speed_ticks) * error;
    if (e->speed_ticks > RATE_AFTER_TICKS)
        e->speed_rate += beta * error;
    return e->speed;
}

void wrcd_table_at(const wrcd_speed_table *table, double speed, double *row)
{
    const double *speeds = table->speed_m_s;
    const int last = table->speeds - 1;
    const double v = speed > speeds[0] ? (speed < speeds[last] ? speed : speeds[last]) : speeds[0];
    int i = 0;

    while (i < last - 1 && speeds[i + 1] < v)
        i++;
    const double t = (v - speeds[i]) / (speeds[i + 1] - speeds[i]);
    const double *below = table->row + (ptrdiff_t)i * table->width, *above = below + table->width;
    for (int k = 0; k < table->width; k++)
        row[k] = (1.0 - t) * below[k] + t * above[k];
}

/* Per model the matrix of x' = A x + B z, e = z - H x, w = W e, by columns over [x; z].
 *
 * Between the design's speeds A = Phi (I - K H) and B = Phi K are linear: with Phi, K and H linear each by itself, a filter
 * that is stable at both ends was not so between them, and its residual grew within a minute. */
static void make_node(const wrcd_design *d, double number, double m[MODELS][WRCD_MAX_STATES + 2][WRCD_MAX_STATES + 4])
{
    enum { S = WRCD_MAX_STATES };
    double A[MODELS * S * S], B[MODELS * S * CHANNELS], H[MODELS * CHANNELS * S], whiten[MODELS * CHANNELS * CHANNELS];
    const double speed = number * SPEED_STEP;
    const int s = d->states;

    wrcd_table_at(&d->A, speed, A);
    wrcd_table_at(&d->B, speed, B);
    wrcd_table_at(&d->H, speed, H);
    wrcd_table_at(&d->W, speed, whiten);
    for (int k = 0; k < MODELS; k++) {
        const double *h = H + k * CHANNELS * s, *w = whiten + k * CHANNELS * CHANNELS;
        for (int c = 0; c < s; c++) {
            for (int r = 0; r < s; r++)
                m[k][c][r] = A[(k * s + r) * s + c];
            for (int r = 0; r < CHANNELS; r++) {
                m[k][c][s + r] = -h[r * s + c];
                m[k][c][s + CHANNELS + r] = -(w[r * CHANNELS] * h[c] + w[r * CHANNELS + 1] * h[s + c]);
            }
        }
        for (int c = 0; c < CHANNELS; c++) {
            for (int r = 0; r < s; r++)
                m[k][s + c][r] = B[(k * s + r) * CHANNELS + c];
            for (int r = 0; r < CHANNELS; r++) {
                m[k][s + c][s + r] = r == c ? 1.0 : 0.0;
                m[k][s + c][s + CHANNELS + r] = w[r * CHANNELS + c];
            }
        }
    }
}

/* The matrices at a speed, linear between nodes: a speed that moves about never makes the gains toggle. */
void wrcd_bank_at(wrcd_estimator *e, const wrcd_design *d, double speed_m_s, bank_matrices *at)
{
    const double low = d->speed_low_m_s, high = d->speed_high_m_s;
    const double place = (speed_m_s > low ? (speed_m_s < high ? speed_m_s : high) : low) / SPEED_STEP;
    const double node = floor(place);
    const int s = d->states;

    if (node != e->node) {
        e->node = node;
        make_node(d, node, e->below);
        make_node(d, node + 1.0, e->rise);
        for (int k = 0; k < MODELS; k++)
            for (int c = 0; c < s + CHANNELS; c++)
                for (int r = 0; r < s + 2 * CHANNELS; r++)
                    e->rise[k][c][r] -= e->below[k][c][r];
    }
    for (int k = 0; k < MODELS; k++)
        for (int c = 0; c < s + CHANNELS; c++)
            for (int r = 0; r < s + 2 * CHANNELS; r++)
                at->m[k][c][r] = e->below[k][c][r] + (place - node) * e->rise[k][c][r];
}

/* One tick of an axle. What is not present counts as what the model predicts: its innovation is exactly zero. */
static inline void step(const bank_matrices *at, int s, double x[MODELS][WRCD_MAX_STATES], const double z[CHANNELS],
                        bool present, double innovation[MODELS][CHANNELS], double whitened[MODELS][CHANNELS])
{
    for (int k = 0; k < MODELS; k++) {
        double from[WRCD_MAX_STATES + CHANNELS], out[WRCD_MAX_STATES + 2 * CHANNELS] = {0.0};

        memcpy(from, x[k], (size_t)s * sizeof(double));
        for (int c = 0; c < CHANNELS; c++) {
            from[s + c] = z[c];
            if (!present) {
                from[s + c] = 0.0;
                for (int i = 0; i < s; i++)
                    from[s + c] -= at->m[k][i][s + c] * x[k][i];
            }
        }
        for (int i = 0; i < s + CHANNELS; i++)
            for (int r = 0; r < s + 2 * CHANNELS; r++)
                out[r] += at->m[k][i][r] * from[i];
        memcpy(x[k], out, (size_t)s * sizeof(double));
        for (int c = 0; c < CHANNELS; c++) {
            innovation[k][c] = present ? out[s + c] : 0.0;
            whitened[k][c] = present ? out[s + CHANNELS + c] : 0.0;
        }
    }
}

/* The same: a compiler that knows the number of states unrolls their loops. */
void wrcd_bank_step(const bank_matrices *at, int s, double x[MODELS][WRCD_MAX_STATES], const double z[CHANNELS], bool present,
               double innovation[MODELS][CHANNELS], double whitened[MODELS][CHANNELS])
{
    if (s == PACKAGED_STATES)
        step(at, PACKAGED_STATES, x, z, present, innovation, whitened);
    else
        step(at, s, x, z, present, innovation, whitened);
}
