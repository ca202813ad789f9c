/* Fuzzy inference, Figs. 7 to 10: rules over four residuals, torque and speed. As paper/fuzzy.py. */
#include "parts.h"

static const double MIN_FIRING = 0.05, LOG_SPREADS[2] = {-2.7, 0.3};

/* The degrees of an input's triangular sets, which add up to one; beyond its outermost sets it counts as at their middle. */
static void degrees_of(const wrcd_design *d, int input, double x, double degree[WRCD_MAX_SETS])
{
    const double *c = d->centres[input];
    const int last = d->sets[input] - 1;

    x = held(x, c[0], c[last]);
    for (int k = 0; k <= last; k++) {
        const double rise = k == 0 ? x - (c[0] - 1.0) : (x - c[k - 1]) / (c[k] - c[k - 1]);
        const double fall = k == last ? c[last] + 1.0 - x : (c[k + 1] - x) / (c[k + 1] - c[k]);
        degree[k] = held(lesser(rise, fall), 0.0, 1.0);
    }
}

/* A rule's weight is the product of its sets' degrees; the output is the weighted mean of what the rules say: a base,
 * changed by slopes as the inputs move away from the middle of the rule's sets (Takagi's and Sugeno's form). */
void wrcd_rules_infer(const wrcd_design *d, const double inputs[WRCD_COLUMNS], rules_answer *answer)
{
    enum { SAID = 2 * (WRCD_COLUMNS + 1) };
    double degree[WRCD_INPUTS][WRCD_MAX_SETS], weight[WRCD_MAX_RULES], said[SAID] = {0.0}, firing = 0.0;
    int heaviest = 0;

    for (int i = 0; i < WRCD_INPUTS; i++)
        degrees_of(d, i, inputs[i], degree[i]);
    for (int r = 0; r < d->rules; r++) {
        const int *set = d->rule_sets + r * WRCD_INPUTS;
        weight[r] = degree[0][set[0]] * degree[1][set[1]] * (degree[2][set[2]] * degree[3][set[3]])
            * (degree[4][set[4]] * degree[5][set[5]]);
        firing += weight[r];
        if (weight[r] > weight[heaviest])
            heaviest = r;
    }
    answer->firing = firing;
    if (!(firing >= MIN_FIRING)) {
        answer->output = answer->rule_share = answer->spread = NAN;
        answer->rule = 0;
        return;
    }
    for (int r = 0; r < d->rules; r++) {
        const double share = weight[r] / firing, *consequent = d->consequents + r * SAID;
        if (share == 0.0)
            continue;
        for (int c = 0; c < SAID; c++)
            said[c] += share * consequent[c];
    }
    double both[2] = {said[WRCD_COLUMNS], said[SAID - 1]};
    for (int c = 0; c < WRCD_COLUMNS; c++) {
        const double x = held(inputs[c], d->low[c], d->high[c]);
        both[0] += said[c] * x;
        both[1] += said[WRCD_COLUMNS + 1 + c] * x;
    }
    answer->output = held(both[0], 0.0, 100.0);
    answer->spread = pow(10.0, held(both[1], LOG_SPREADS[0], LOG_SPREADS[1]));
    answer->rule = heaviest + 1;
    answer->rule_share = weight[heaviest] / firing;
}
