// SPDX-License-Identifier: MIT
// Every number of okid_mkr_identify() beside its formula in mkr.h, for models that fit no structure: channels with
// errors, of any gain, on no degree of freedom; modes too many; a wrong feedthrough. And the limits of the notes.
#include "mkr_rig.h"

static structure_t s;
static system_t m;
static residues_t known;

void setUp(void) {}
void tearDown(void) {}

enum { N = 6, EXTRA = 3, MOST = N + EXTRA, TRIALS = 240 };

/// What is expected, from the residues alone.
static struct {
    double complex W[N][N], lambda[N];
    double strength[N], margin, spread[N], mpc[N], phase[N], residual, feedthrough, gain;
    double M[N * N], K[N * N], R[N * N], R_normal[N * N], mobility[N][N];
    int row;
} truth;

static double draw(uint64_t* seed) { return 2 * s_uniform(seed) - 1; }

static double complex error(double size, uint64_t* seed) {
    const double re = draw(seed), im = draw(seed);
    return 1 + size * (re + I * im);
}

/// Structure 2 with three forces and eight sensors, the last of each on no degree of freedom; 1 has forces alone.
static void make(uint64_t seed, double size, double extra) {
    const int32_t forces[] = {0, 3, 1, 2}, sensors[] = {0, 2, 2, 3, 4, 5, 3, 0}, kinds[] = {2, 1, 0, 2, 2, 1, 0, 2};
    s_make(&s, 2);
    s_instrument(&m, 4, forces, 8, sensors, kinds);
    for (int j = 0; j < m.n_u; ++j) m.input_gain[j] = (okid_real_t)((j % 2 ? -1 : 1) * (1 + 0.6 * draw(&seed)));
    for (int o = 0; o < m.n_y; ++o) m.output_gain[o] = (okid_real_t)((o % 3 ? 1 : -1) * (1 + 0.6 * draw(&seed)));
    TEST_ASSERT_EQUAL(OKID_OK, s_continuous(&s, &m)); // for D
    residues_of(&s, &known);
    const double direct = size * (1 + draw(&seed));
    for (int i = 0; i < m.n_y * m.n_u; ++i) m.D[i] = (okid_real_t)((double)m.D[i] * (1 + direct * draw(&seed)));
    for (int k = 0; k < N; ++k) {
        for (int o = 0; o < m.n_y; ++o)
            known.c[k][o] = known.w[k][sensors[o]] * cpow(known.lambda[k], kinds[o]) * (double)m.output_gain[o] *
                            error(size, &seed);
        for (int j = 0; j < m.n_u; ++j)
            known.b[k][j] = known.w[k][forces[j]] * (double)m.input_gain[j] * error(size, &seed);
    }
    known.modes = MOST;
    for (int k = N; k < MOST; ++k) {
        known.lambda[k] = known.lambda[k - N] * (0.8 + 0.05 * k) * (1 + 0.005 * I * draw(&seed));
        for (int o = 0; o < m.n_y; ++o) known.c[k][o] = extra * known.c[k - N][o] * error(0.9, &seed);
        for (int j = 0; j < m.n_u; ++j) known.b[k][j] = known.b[k - N][j] * error(0.9, &seed);
    }
    residues_model(&known, &m);
    for (int k = 0; k < 4; ++k) s_reflect(&m, &seed);
    m.input_dof[3] = m.output_dof[7] = -1;
}

static int paired(int j, int o) { return m.input_dof[j] >= 0 && m.input_dof[j] == m.output_dof[o]; }

/// The strongest N, ascending in |lambda|, into taken.
static void choose(int* taken) {
    double share[MOST] = {0}, left = 0, weakest = 1;
    for (int o = 0; o < m.n_y; ++o)
        for (int j = 0; j < m.n_u; ++j) {
            double each[MOST], total = 0;
            for (int k = 0; k < MOST; ++k)
                total += each[k] = pow(cabs(known.c[k][o] * known.b[k][j]), 2) / fabs(creal(known.lambda[k]));
            for (int k = 0; k < MOST; ++k) share[k] += each[k] / total / (m.n_u * m.n_y);
        }
    int chosen[MOST] = {0};
    for (int i = 0; i < N; ++i) {
        int best = -1;
        for (int k = 0; k < MOST; ++k)
            if (!chosen[k] && (best < 0 || share[k] > share[best])) best = k;
        chosen[best] = 1;
        weakest = share[best];
    }
    for (int k = 0; k < MOST; ++k)
        if (!chosen[k]) left = fmax(left, share[k]);
    truth.margin = weakest / left;
    for (int i = 0; i < N; ++i) {
        int best = -1;
        for (int k = 0; k < MOST; ++k)
            if (chosen[k] == 1 && (best < 0 || cabs(known.lambda[k]) < cabs(known.lambda[best]))) best = k;
        chosen[best] = 2;
        taken[i] = best;
        truth.strength[i] = share[best];
        truth.lambda[i] = known.lambda[best];
    }
}

static double complex force(int k, int j) { return known.b[k][j] / (double)m.input_gain[j]; }
static double complex motion(int k, int o) {
    return known.c[k][o] / (double)m.output_gain[o] / cpow(known.lambda[k], m.sensing[o]);
}

static void scale(int k, double complex* W, double* spread) {
    double complex cross = 0;
    double seen = 0, driven = 0, misfit = 0;
    for (int j = 0; j < m.n_u; ++j)
        for (int o = 0; o < m.n_y; ++o)
            if (paired(j, o)) {
                cross += conj(motion(k, o)) * force(k, j);
                seen += pow(cabs(motion(k, o)), 2);
                driven += pow(cabs(force(k, j)), 2);
            }
    const double complex square = cross / seen, t = csqrt(square);
    for (int j = 0; j < m.n_u; ++j)
        for (int o = 0; o < m.n_y; ++o)
            if (paired(j, o)) misfit += pow(cabs(force(k, j) - square * motion(k, o)), 2);
    *spread = sqrt(misfit / driven);
    for (int d = 0; d < N; ++d) {
        double complex sensed = 0, pushed = 0;
        int sensors = 0, forces = 0;
        for (int o = 0; o < m.n_y; ++o)
            if (m.output_dof[o] == d) sensed += motion(k, o), ++sensors;
        for (int j = 0; j < m.n_u; ++j)
            if (m.input_dof[j] == d) pushed += force(k, j), ++forces;
        W[d] = sensors ? t * sensed / sensors : pushed / t / forces;
    }
}

/// M, K, R, the shapes' phases, R_normal.
static void assemble(void) {
    double complex w[N][S_MAX];
    double row[N] = {0}, square = 0, size = 0, sum[N * N];
    for (int k = 0; k < N; ++k)
        for (int i = 0; i < N; ++i) {
            w[k][i] = truth.W[k][i];
            row[i] += cimag(truth.lambda[k]) * pow(cabs(truth.W[k][i]), 2);
        }
    naive_sum(N, N, truth.lambda, w, 1, 0, 1, truth.M);
    naive_sum(N, N, truth.lambda, w, -1, 0, -1, truth.K);
    naive_sum(N, N, truth.lambda, w, 2, 0, -1, sum);
    s_invert(N, sum); // - 2 Re W L^2 W^T
    for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j) {
            truth.R[j * N + i] = truth.R_normal[j * N + i] = truth.mobility[i][j] = 0;
            for (int a = 0; a < N; ++a)
                for (int b = 0; b < N; ++b)
                    truth.R[j * N + i] += truth.M[a * N + i] * sum[b * N + a] * truth.M[j * N + b];
            double closure = 0;
            for (int k = 0; k < N; ++k) {
                closure += 2 * creal(w[k][i] * w[k][j]);
                truth.mobility[i][j] += 2 * creal(truth.lambda[k] * w[k][i] * w[k][j]);
            }
            square += closure * closure / row[i] / row[j];
            size += pow(cabs(w[j][i]), 2) / row[i];
        }
    truth.residual = sqrt(square) / (2 * size);
    for (int k = 0; k < N; ++k) {
        const double complex turn = csqrt(2 * I * cimag(truth.lambda[k]));
        double complex squares = 0;
        double sizes = 0, F[N], MF[N] = {0}, mass = 0;
        for (int i = 0; i < N; ++i) {
            const double complex v = turn * w[k][i] / sqrt(row[i]);
            squares += v * v;
            sizes += pow(cabs(v), 2);
        }
        truth.phase[k] = carg(squares) / 2;
        truth.mpc[k] = pow(cabs(squares) / sizes, 2);
        for (int i = 0; i < N; ++i) F[i] = creal(turn * w[k][i] * cexp(-I * truth.phase[k]));
        for (int i = 0; i < N; ++i)
            for (int j = 0; j < N; ++j) MF[i] += truth.M[j * N + i] * F[j];
        for (int i = 0; i < N; ++i) mass += F[i] * MF[i];
        for (int i = 0; i < N; ++i)
            for (int j = 0; j < N; ++j) truth.R_normal[j * N + i] += MF[i] * MF[j] * -2 * creal(truth.lambda[k]) / mass;
    }
}

static void look_at_the_feedthrough(const int* taken) {
    double along = 0, length = 0;
    truth.feedthrough = 0;
    for (int o = 0; o < m.n_y; ++o) {
        double misfit = 0, size = 0;
        for (int j = 0; j < m.n_u; ++j) {
            if (m.input_dof[j] < 0 || m.output_dof[o] < 0) continue;
            double modes = 0;
            for (int k = 0; k < N; ++k)
                modes += 2 * cabs(known.c[taken[k]][o] * known.b[taken[k]][j] / truth.lambda[k]);
            const double gains = (double)m.output_gain[o] * (double)m.input_gain[j], direct = m.D[j * m.n_y + o];
            const double right = m.sensing[o] == 2 ? truth.mobility[m.output_dof[o]][m.input_dof[j]] : 0;
            misfit += pow(direct - gains * right, 2);
            size += modes * modes;
            if (m.sensing[o] != 2 || m.input_dof[j] != m.output_dof[o]) continue;
            along += direct / gains * right;
            length += right * right;
        }
        if (!(size > 0) || sqrt(misfit / size) < truth.feedthrough) continue;
        truth.feedthrough = sqrt(misfit / size);
        truth.row = o;
    }
    truth.gain = along / length;
}

static void expect(void) {
    int taken[N];
    choose(taken);
    for (int k = 0; k < N; ++k) scale(taken[k], truth.W[k], &truth.spread[k]);
    assemble();
    look_at_the_feedthrough(taken);
}

static double off(const okid_real_t* found, const double* expected) {
    double d = 0, size = 0;
    for (int i = 0; i < N * N; ++i) d += pow(found[i] - expected[i], 2), size += pow(expected[i], 2);
    return sqrt(d / size);
}

static void near(double expected, double found) {
    TEST_ASSERT_DOUBLE_WITHIN(1e-7 * (1e-2 + fabs(expected)), expected, found);
}

static void every_number_is_that_of_its_formula(void) {
    for (int trial = 0; trial < 40; ++trial) {
        make(1 + (uint64_t)trial, 0.004 * (trial % 20), 0.02 * (1 + trial % 7));
        expect();
        TEST_ASSERT_TRUE(mkr_run(&m, N, OKID_HOLD_ZERO) >= 0);
        TEST_ASSERT_EQUAL(MOST, result.admissible);
        TEST_ASSERT_EQUAL(3, result.pairs); // one on 0, two on 3
        for (int k = 0; k < N; ++k) {
            near(truth.strength[k], result.strength[k]);
            near(truth.spread[k], result.pair_spread[k]);
            near(truth.mpc[k], result.mpc[k]);
            near(0, sin(truth.phase[k] - result.phase[k]));
            near(0, cabs(truth.lambda[k] / (result.lambda_re[k] + I * result.lambda_im[k]) - 1));
            near(cabs(truth.lambda[k]) / (2 * RIG_PI), result.frequency_hz[k]);
            near(-creal(truth.lambda[k]) / cabs(truth.lambda[k]), result.damping_ratio[k]);
            for (int i = 0; i < N; ++i) { // of either sign
                const double complex w = result.W_re[k * N + i] + I * result.W_im[k * N + i];
                near(0, cabs(w * w / (truth.W[k][i] * truth.W[k][i]) - 1));
            }
        }
        near(truth.margin, result.margin);
        near(truth.residual, result.residual);
        near(truth.feedthrough, result.feedthrough);
        near(truth.gain, result.gain);
        if (truth.feedthrough > 1e-6) TEST_ASSERT_EQUAL(truth.row, result.feedthrough_row); // else rounding decides
        TEST_ASSERT_TRUE(off(result.M, truth.M) < 1e-7);
        TEST_ASSERT_TRUE(off(result.K, truth.K) < 1e-7);
        TEST_ASSERT_TRUE(off(result.R, truth.R) < 1e-7);
        TEST_ASSERT_TRUE(off(result.R_normal, truth.R_normal) < 1e-7);
    }
}

/// Positive definite, by the signs of the pivots.
static int definite(const okid_real_t* a, double sign) {
    double x[N * N];
    for (int i = 0; i < N * N; ++i) x[i] = sign * a[i];
    for (int k = 0; k < N; ++k) {
        if (!(x[k * N + k] > 0)) return 0;
        for (int j = k + 1; j < N; ++j)
            for (int i = k + 1; i < N; ++i) x[j * N + i] -= x[k * N + i] * x[j * N + k] / x[k * N + k];
    }
    return 1;
}

static struct {
    int below, above;
} seen[5];

/// The note stands exactly where the value is beyond its limit; how often it came near from either side is counted.
static void note_follows(int k, uint32_t bit, double value, double limit, int above) {
    TEST_ASSERT_EQUAL((above ? value > limit : value < limit) ? bit : 0, result.notes & bit);
    seen[k].below += value <= limit && value > 0.75 * limit;
    seen[k].above += value >= limit && value < 1.25 * limit;
}

static void notes_begin_at_their_limits(void) {
    for (int trial = 0; trial < TRIALS; ++trial) {
        make(100 + (uint64_t)trial, 0.3 * trial / TRIALS, 0.1 + 0.05 * (trial % 9));
        TEST_ASSERT_TRUE(mkr_run(&m, N, OKID_HOLD_ZERO) >= 0);
        double mpc = 1, spread = 0;
        for (int k = 0; k < N; ++k) {
            mpc = fmin(mpc, result.mpc[k]);
            spread = fmax(spread, result.pair_spread[k]);
        }
        note_follows(0, OKID_MKR_RESIDUAL, result.residual, 0.03, 1);
        note_follows(1, OKID_MKR_FEEDTHROUGH, result.feedthrough, 0.1, 1);
        note_follows(2, OKID_MKR_COMPLEX, mpc, 0.9, 0);
        note_follows(3, OKID_MKR_SPREAD, spread, 0.1, 1);
        note_follows(4, OKID_MKR_CLOSE, result.margin, 2, 0);
        const uint32_t signs = (definite(result.M, -1) ? OKID_MKR_POLARITY : 0) |
                               (definite(result.M, 1) || definite(result.M, -1) ? 0 : OKID_MKR_MASS) |
                               (definite(result.K, 1) ? 0 : OKID_MKR_STIFFNESS) |
                               (definite(result.R, 1) ? 0 : OKID_MKR_DAMPING);
        TEST_ASSERT_EQUAL(signs,
                          result.notes & (OKID_MKR_POLARITY | OKID_MKR_MASS | OKID_MKR_STIFFNESS | OKID_MKR_DAMPING));
    }
    for (int k = 0; k < 5; ++k) TEST_ASSERT_TRUE(seen[k].below > 0 && seen[k].above > 0);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(every_number_is_that_of_its_formula);
    RUN_TEST(notes_begin_at_their_limits);
    return UNITY_END();
}
