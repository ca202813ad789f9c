/* What a bogie's calm signals say of the vehicle: whether they are likelier of another one than of the design's own.
 *
 * Nothing is fitted to all blocks again and again. A block is looked at with the most likely unknowns of a vehicle within the
 * scatter of the design's: powers (of each bin), creep slopes and incoherence (of the block) climb to their best, then come
 * the gradient and the Fisher matrix of the others (likelihood.c), without these (Schur complements), and are added to a sum
 * that forgets. Where that leads far, it is looked at again from there. The sum with two priors answers: the design's vehicle
 * within its scatter, and any vehicle. Twice the difference of their log-likelihoods is the ratio. Where that is large, the
 * next blocks are looked at with the other vehicle, too, for how incoherent it leaves them.
 *
 * One bin of a block is looked at in a tick: no tick is long. */
#include "fit.h"

enum { MAX_PASSES = 9, MOST_AGAIN = 3 };
static const double ENOUGH = 0.03, MOST_STEP = 0.5;
static const double KEPT = 0.99;       /* of the sum, at each stretch */
/* Of what is expected: a block that is stronger is another thing, a flange at the rail; one that is weaker is no signal. */
static const double MIN_FIT = 0.3, MAX_FIT = 1.5;
static const double LEAST_SLOPE = -1.2; /* log of the creep force's secant over a damp rail's: near saturation nothing is linear */
static const double LEAST_WEIGHT = 20.0; /* stretches, before there is a verdict */
static const double FAR = 6.0;         /* gain for which a block is looked at once more, from where it led to */
static const double FARTHEST = 0.5;    /* that an unknown moves with a block: all is linear about them */
/* Ratios from which a vehicle is another one, and still is. In 316 simulated hours of own vehicles (off as the training draws
 * them, curves, wet rails, shaken axle boxes) three were called another; of 34 others 33 were found within 26 minutes. */
static const double UNLIKE = 60.0, STILL_UNLIKE = 30.0;
static const double COHERENT = 0.10, STILL_COHERENT = 0.12; /* the most that a vehicle may leave incoherent */
static const double INFORMED_PP = 0.75; /* the most that the bias's standard deviation may be, to call a vehicle the own one */

/* What powers are expected about: a curve of second order over the log of the wave number, which follows them. */
static void smooth(const wrcd_fit_table *f, wrcd_bogie_state *b)
{
    double along[3][POWERS] = {{0.0}};

    for (int k = 0; k < 3; k++)
        for (int bin = 0; bin < BINS; bin++)
            for (int p = 0; p < POWERS; p++)
                along[k][p] += f->basis[k * BINS + bin] * b->powers[bin][p];
    memset(b->expected, 0, sizeof b->expected);
    for (int k = 0; k < 3; k++)
        for (int bin = 0; bin < BINS; bin++)
            for (int p = 0; p < POWERS; p++)
                b->expected[bin][p] += f->basis[k * BINS + bin] * along[k][p];
}

/* What is known of a block's unknowns before. Returns its part of the log-likelihood. */
static double add_block_prior(const wrcd_fit_table *f, wrcd_bogie_state *b)
{
    double sum = 0.0;

    for (int s = 0; s < OF_BLOCK; s++) {
        const double tight = 1.0 / (f->block_sigma[s] * f->block_sigma[s]);
        b->gradient[UNKNOWNS + s] -= b->of_block[s] * tight;
        b->fisher[UNKNOWNS + s][UNKNOWNS + s] += tight;
        sum -= 0.5 * b->of_block[s] * b->of_block[s] * tight;
    }
    return sum;
}

/* What the block adds to the sum: the upper triangle of its Fisher matrix, and its diagonal, which solving overwrites. */
typedef struct { double diagonal[UNKNOWNS], score[UNKNOWNS], kept; } addition;

static double summed(const wrcd_bogie_state *b, const addition *a, int i, int j)
{
    const double of_block = i == j ? a->diagonal[i] : i < j ? b->fisher[i][j] : b->fisher[j][i];

    return a->kept * b->information[i][j] + of_block;
}

/* Solve (sum + prior) x = score by Cholesky, in the lower triangle of the block's Fisher matrix. Returns whether it could be;
 * gives the variance along `along`, too, where that is asked for. */
static bool solve_sum(wrcd_bogie_state *b, const addition *a, const double sigma[UNKNOWNS], double x[UNKNOWNS], const double *along,
                      double *variance)
{
    double half[UNKNOWNS];

    for (int i = 0; i < UNKNOWNS; i++)
        for (int j = 0; j <= i; j++) {
            double rest = summed(b, a, i, j) + (i == j ? 1.0 / (sigma[i] * sigma[i]) : 0.0);
            rest -= wrcd_dot(b->fisher[i], b->fisher[j], j);
            if (i == j && !(rest > 0.0))
                return false;
            b->fisher[i][j] = i == j ? sqrt(rest) : rest / b->fisher[j][j];
        }
    for (int i = 0; i < UNKNOWNS; i++)
        x[i] = (a->score[i] - wrcd_dot(b->fisher[i], x, i)) / b->fisher[i][i];
    for (int i = UNKNOWNS - 1; i >= 0; i--) {
        for (int j = i + 1; j < UNKNOWNS; j++)
            x[i] -= b->fisher[j][i] * x[j];
        x[i] /= b->fisher[i][i];
    }
    for (int i = 0; along != NULL && i < UNKNOWNS; i++)
        half[i] = (along[i] - wrcd_dot(b->fisher[i], half, i)) / b->fisher[i][i];
    if (along != NULL)
        *variance = wrcd_dot(half, half, UNKNOWNS);
    return true;
}

/* What is gained, were all linear, by going from the unknowns to the sum's. */
static double gain_of(const wrcd_bogie_state *b, const addition *a, const double sigma[UNKNOWNS], const double own[UNKNOWNS])
{
    double gain = 0.0;

    for (int i = 0; i < UNKNOWNS; i++) {
        double rest = a->score[i] - b->at[i] / (sigma[i] * sigma[i]);
        for (int j = 0; j < UNKNOWNS; j++)
            rest -= summed(b, a, i, j) * b->at[j];
        gain += rest * (own[i] - b->at[i]);
    }
    return gain;
}

/* Of a block that is added: by how much a vehicle leaves it incoherent. */
static void note_incoherence(wrcd_bogie_state *b, bool another, double kept, double log_of_share)
{
    b->incoherent[another] = kept * b->incoherent[another] + b->of_stretches * log_of_share;
    b->looks[another] = kept * b->looks[another] + b->of_stretches;
}

static double incoherence_of(const wrcd_fit_table *f, const wrcd_bogie_state *b, bool another)
{
    return b->looks[another] > 0.0 ? f->incoherence * exp(b->incoherent[another] / b->looks[another]) : INFINITY;
}

/* Another vehicle has to be far likelier, and to explain what the sensors give: those of a shaken axle box it does not. Nor is
 * a vehicle the own one where that does not explain them, or where they hold nothing. */
static int verdict_of(const wrcd_fit_table *f, const wrcd_bogie_state *b)
{
    const bool still = b->verdict == WRCD_FIT_UNLIKE;

    if (b->ratio >= (still ? STILL_UNLIKE : UNLIKE) && incoherence_of(f, b, true) <= (still ? STILL_COHERENT : COHERENT))
        return WRCD_FIT_UNLIKE;
    if (b->ratio >= UNSURE || b->incoherence > COHERENT)
        return WRCD_FIT_UNSURE;
    return b->bias_sigma_pp <= INFORMED_PP ? WRCD_FIT_LIKE : WRCD_FIT_UNKNOWN;
}

static void go_to(const wrcd_bogie_state *b, const double own[UNKNOWNS], double to[UNKNOWNS])
{
    for (int u = 0; u < UNKNOWNS; u++)
        to[u] = b->at[u] + held(own[u] - b->at[u], -FARTHEST, FARTHEST);
}

/* A block that is not added ages what was: a verdict without new ones ends. One from before the train turned round holds. */
static bool refuse(wrcd_bogie_state *b, double kept)
{
    const bool spoke = b->weight >= LEAST_WEIGHT;

    b->weight *= kept;
    for (int i = 0; i < UNKNOWNS; i++) {
        b->score[i] *= kept;
        for (int j = 0; j < UNKNOWNS; j++)
            b->information[i][j] *= kept;
    }
    b->verdict = spoke && b->weight < LEAST_WEIGHT ? WRCD_FIT_UNKNOWN : b->verdict;
    return true;
}

/* Add the block to the sum, and ask it. Returns false where the block is to be looked at once more, from nearer. */
static bool conclude(const wrcd_fit_table *f, wrcd_bogie_state *b)
{
    double free[UNKNOWNS], own[UNKNOWNS], variance = 0.0;
    addition a = {.kept = pow(KEPT, b->of_stretches)};

    if (!(b->misfit >= MIN_FIT && b->misfit <= MAX_FIT && b->of_block[SECANT] >= LEAST_SLOPE))
        return refuse(b, a.kept);
    add_block_prior(f, b);
    wrcd_eliminate(&b->fisher[0][0], COLUMNS, b->gradient, UNKNOWNS, COLUMNS);
    for (int i = 0; i < UNKNOWNS; i++) {
        a.diagonal[i] = b->fisher[i][i];
        a.score[i] = a.kept * b->score[i] + b->gradient[i] + wrcd_dot(b->fisher[i], b->at, UNKNOWNS);
    }
    if (!solve_sum(b, &a, f->own_sigma, own, NULL, NULL) || !isfinite(wrcd_dot(a.score, own, UNKNOWNS)))
        return refuse(b, a.kept);
    if (b->again < MOST_AGAIN && gain_of(b, &a, f->own_sigma, own) > FAR) {
        go_to(b, own, b->at);
        b->again++;
        return false;
    }
    if (!solve_sum(b, &a, f->free_sigma, free, f->bias, &variance))
        return refuse(b, a.kept);
    for (int i = 0; i < UNKNOWNS; i++)
        for (int j = i; j < UNKNOWNS; j++)
            b->information[i][j] = b->information[j][i] = summed(b, &a, i, j);
    memcpy(b->score, a.score, sizeof a.score);
    b->weight = a.kept * b->weight + b->of_stretches;
    go_to(b, own, b->unknowns);
    note_incoherence(b, false, a.kept, b->of_block[INCOHERENT]);
    if (!isnan(b->of_another))
        note_incoherence(b, true, a.kept, b->of_another);
    if (b->weight < LEAST_WEIGHT && b->verdict != WRCD_FIT_UNKNOWN) /* the verdict from before the train turned round holds */
        return true;
    b->ratio = wrcd_dot(free, b->score, UNKNOWNS) - wrcd_dot(own, b->score, UNKNOWNS);
    b->bias_pp = wrcd_dot(free, f->bias, UNKNOWNS);
    b->bias_sigma_pp = sqrt(variance);
    b->incoherence = incoherence_of(f, b, false);
    memcpy(b->free, free, sizeof free);
    b->verdict = b->weight < LEAST_WEIGHT ? WRCD_FIT_UNKNOWN : verdict_of(f, b);
    return true;
}

static void look_from(wrcd_bogie_state *b, bool another)
{
    b->is_of_another = another;
    memcpy(b->at, another ? b->free : b->unknowns, sizeof b->at);
    memcpy(b->of_block, b->best_of_block, sizeof b->of_block); /* of the block before: the rail changes slowly */
    b->pass = FIRST_PASS;
}

/* The end of a pass: the next step of the block's unknowns, or the last pass at the best. */
static void end_pass(const wrcd_fit_table *f, wrcd_bogie_state *b)
{
    double size = 0.0;

    if (b->pass > FIRST_PASS) {
        b->objective += add_block_prior(f, b);
        if (b->pass == FIRST_PASS + 1 || b->objective > b->best) {
            b->best = b->objective;
            memcpy(b->best_of_block, b->of_block, sizeof b->of_block);
            wrcd_solve(&b->fisher[UNKNOWNS][UNKNOWNS], COLUMNS, b->gradient + UNKNOWNS, OF_BLOCK, b->step);
        } else {
            for (int s = 0; s < OF_BLOCK; s++)
                b->step[s] *= 0.25;
        }
        for (int s = 0; s < OF_BLOCK; s++) {
            b->step[s] = held(b->step[s], -MOST_STEP, MOST_STEP);
            size = fmax(size, fabs(b->step[s]));
            b->of_block[s] = b->best_of_block[s] + b->step[s];
        }
        if (!(size >= ENOUGH) || b->pass + 1 >= MAX_PASSES) {
            memcpy(b->of_block, b->best_of_block, sizeof b->of_block);
            b->pass = LAST_PASS - 1;
            if (b->is_of_another) {
                b->of_another = b->of_block[INCOHERENT];
                look_from(b, false);
                return;
            }
        }
    }
    smooth(f, b);
    b->pass++;
    b->objective = b->misfit = 0.0;
    memset(b->fisher, 0, sizeof b->fisher);
    memset(b->gradient, 0, sizeof b->gradient);
}

void wrcd_fit_reset(wrcd_bogie_state *b)
{
    memset(&b->ticks, 0, offsetof(wrcd_bogie_state, information) - offsetof(wrcd_bogie_state, ticks));
}

void wrcd_fit_step(const wrcd_fit_table *f, wrcd_bogie_state *b, bool is_reverse, int64_t tick, const double z[SIGNALS],
                   const bool is_there[SIGNALS], double speed_m_s)
{
    if (b->is_reverse != is_reverse) /* each sensor's errors are another wheelset's now; the verdict holds until there is more */
        memset(&b->ticks, 0, sizeof *b - offsetof(wrcd_bogie_state, ticks));
    b->is_reverse = is_reverse;
    if (b->pass > 0) {
        wrcd_look_at(f, b, b->bin++);
        if (b->bin == BINS && b->pass == LAST_PASS)
            b->pass = conclude(f, b) ? 0 : FIRST_PASS;
        if (b->bin == BINS && b->pass > 0)
            end_pass(f, b);
        b->bin = b->bin == BINS ? 0 : b->bin;
    }
    if (wrcd_calm_step(f, b, tick, z, is_there, speed_m_s)) {
        b->bin = b->again = 0;
        b->of_another = NAN;
        look_from(b, b->ratio >= UNSURE);
    }
}
