// SPDX-License-Identifier: MIT
// Every number of okid_skew_finish() beside its formula, for modes whose angles are chosen: delays, their deviations
// over the replicates, the scatter, and where an output counts as late.
#include "mkr_rig.h"

#include <okid/steps/skew.h>

enum { N = 6, NY = 6, BLOCKS = 7 };

static structure_t s;
static system_t m;
static residues_t real_modes, known;
static okid_mkr_config_t mkr;
static void* block;
static okid_skew_t* skew;
static double angle[N][NY], turned[BLOCKS][N][NY];

void setUp(void) {
    const int32_t forces[] = {0, 3}, sensors[] = {0, 1, 2, 3, 4, 5}, kinds[] = {2, 0, 1, 2, 2, 0};
    s_make(&s, 2);
    s_instrument(&m, 2, forces, NY, sensors, kinds);
    TEST_ASSERT_EQUAL(OKID_OK, s_continuous(&s, &m)); // for D
    residues_of(&s, &real_modes);
    mkr = okid_mkr_defaults(N, m.dt);
    mkr.input_dof = m.input_dof;
    mkr.output_dof = m.output_dof;
    mkr.output_sensing = m.sensing;
    const okid_skew_config_t c = {m.n_u, NY, 2 * N, BLOCKS, &mkr};
    const size_t bytes = okid_skew_memsize(&c);
    block = malloc(bytes);
    TEST_ASSERT_EQUAL(OKID_OK, okid_skew_create(&skew, &c, block, bytes));
}

void tearDown(void) { free(block); }

static double draw(uint64_t* seed) { return 2 * s_uniform(seed) - 1; }

/// The model whose mode k stands in output o at `angle` and more.
static okid_model_t turned_model(double more[N][NY], uint64_t seed) {
    known = real_modes;
    residues_channels(&known, &m, 1.3 * cexp(0.4 * I));
    for (int k = 0; k < N; ++k)
        for (int o = 0; o < NY; ++o) known.c[k][o] *= cexp(I * (angle[k][o] + (more ? more[k][o] : 0)));
    residues_model(&known, &m);
    for (int k = 0; k < 3; ++k) s_reflect(&m, &seed);
    return s_view(&m);
}

/// sqrt((n - 1)/n sum of squares)
static double deviation(const double* differences) {
    double sum = 0;
    for (int r = 0; r < BLOCKS; ++r) sum += differences[r] * differences[r];
    return sqrt(sum * (BLOCKS - 1) / BLOCKS);
}

static double turn_of(int k) { return cimag(real_modes.lambda[k]); }

static double slope(const double* weight, const double* angles) {
    double up = 0, down = 0;
    for (int k = 0; k < N; ++k) {
        up -= weight[k] * turn_of(k) * angles[k];
        down += weight[k] * turn_of(k) * turn_of(k);
    }
    return down > 0 ? up / down : 0;
}

static struct {
    double delay[NY], std[NY], scatter;
} truth;

static void expect(void) {
    double sum = 0;
    int count = 0;
    for (int o = 0; o < NY; ++o) {
        double weight[N], column[N], each[BLOCKS], slopes[BLOCKS];
        for (int k = 0; k < N; ++k) {
            for (int r = 0; r < BLOCKS; ++r) each[r] = turned[r][k][o];
            const double sigma = deviation(each);
            weight[k] = sigma < 0.3 ? 1 / (sigma * sigma + 1e-8) : 0;
        }
        for (int r = 0; r < BLOCKS; ++r) {
            for (int k = 0; k < N; ++k) column[k] = turned[r][k][o];
            slopes[r] = slope(weight, column);
        }
        for (int k = 0; k < N; ++k) column[k] = remainder(angle[k][o], RIG_PI);
        truth.delay[o] = slope(weight, column);
        truth.std[o] = deviation(slopes);
        for (int k = 0; k < N; ++k) {
            if (weight[k] == 0) continue;
            for (int r = 0; r < BLOCKS; ++r) each[r] = turned[r][k][o] + turn_of(k) * slopes[r];
            const double rest = remainder(column[k] + turn_of(k) * truth.delay[o], RIG_PI);
            sum += rest * rest / (pow(deviation(each), 2) + 1e-8);
            ++count;
        }
    }
    truth.scatter = count > 0 ? sqrt(sum / count) : 0;
}

static void near(double expected, double found, double size) {
    TEST_ASSERT_DOUBLE_WITHIN(1e-6 * size, expected, found);
}

/// How often each outcome was met, so that no limit goes untried.
static struct {
    int late, early, large, below, scattered, less, blurred;
} met;

static void one_trial(uint64_t seed) {
    double late[NY], noise = 0.002 * pow(10, 1.5 * draw(&seed)), misfit = 9 * noise * s_uniform(&seed);
    for (int o = 0; o < NY; ++o) late[o] = m.dt * 0.7 * pow(10, -2 + 2 * s_uniform(&seed)) * (draw(&seed) > 0 ? 1 : -1);
    for (int k = 0; k < N; ++k)
        for (int o = 0; o < NY; ++o) angle[k][o] = -turn_of(k) * late[o] + misfit * draw(&seed);
    okid_model_t model = turned_model(NULL, seed);
    TEST_ASSERT_TRUE(okid_skew_begin(skew, &model) >= 0);
    for (int r = 0; r < BLOCKS; ++r) {
        for (int k = 0; k < N; ++k)
            for (int o = 0; o < NY; ++o)
                turned[r][k][o] = draw(&seed) * (k == 2 && o % 2 ? 0.2 + 0.1 * s_uniform(&seed) : noise);
        model = turned_model(turned[r], seed + (uint64_t)r);
        TEST_ASSERT_EQUAL(OKID_OK, okid_skew_add(skew, &model));
    }
    okid_skew_result_t found;
    const okid_status_t status = okid_skew_finish(skew, &found);
    expect();
    near(truth.scatter, found.scatter, truth.scatter);
    const int undetermined = truth.scatter > 3;
    TEST_ASSERT_EQUAL_INT32(undetermined, found.undetermined);
    TEST_ASSERT_EQUAL(undetermined ? OKID_WARN_MODEL : OKID_OK, status);
    met.scattered += undetermined && truth.scatter < 4;
    met.less += !undetermined && truth.scatter > 2;
    int corrected = 0;
    for (int o = 0; o < NY; ++o) {
        const double delay = truth.delay[o], std = truth.std[o];
        near(delay, found.delay[o], m.dt);
        near(std, found.std[o], m.dt);
        const int seen = fabs(delay) > 4 * std, large = fabs(delay) > 0.3 * m.dt;
        TEST_ASSERT_EQUAL_INT32(seen && !large && !undetermined, found.late[o]);
        TEST_ASSERT_EQUAL_INT32(seen && large, found.too_large[o]);
        corrected += found.late[o];
        met.late += seen && fabs(delay) < 5 * std;
        met.early += !seen && fabs(delay) > 3 * std;
        met.large += seen && large;
        met.below += seen && !large && fabs(delay) > 0.2 * m.dt;
    }
    TEST_ASSERT_EQUAL_INT32(corrected, found.corrected);
    TEST_ASSERT_EQUAL_INT32(NY, found.n_y);
    for (int o = 1; o < NY; o += 2) {
        double each[BLOCKS];
        for (int r = 0; r < BLOCKS; ++r) each[r] = turned[r][2][o];
        met.blurred += deviation(each) >= 0.3 && deviation(each) < 0.4;
    }
}

static void delays_deviations_and_scatter_are_those_of_the_formulas(void) {
    for (uint64_t seed = 1; seed <= 300; ++seed) one_trial(seed);
    TEST_ASSERT_TRUE(met.late > 0 && met.early > 0 && met.large > 0 && met.below > 0);
    TEST_ASSERT_TRUE(met.scattered > 0 && met.less > 0 && met.blurred > 0);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(delays_deviations_and_scatter_are_those_of_the_formulas);
    return UNITY_END();
}
