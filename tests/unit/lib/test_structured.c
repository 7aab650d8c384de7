// SPDX-License-Identifier: MIT
// The structured solver against the dense one on the Gram matrix of the same record, its memory and its errors.
#include "modal_rig.h"

#include <okid/okid.h>
#include <okid/steps/observer.h>
#include <unity.h>

enum { P = 20, N = 4000, LAST = 100, M_MAX = 7, NY_MAX = 5, W_MAX = M_MAX * (P + 1) };

static rig_t rig;
static int n_u, n_y, m, w, q, samples; // of the record in hand
static double S[M_MAX * W_MAX], head[M_MAX * P], tail[M_MAX * P], sum[M_MAX], gram[W_MAX * W_MAX];
static okid_real_t theta[NY_MAX * W_MAX], innovation[NY_MAX * NY_MAX], markov[(LAST + 1) * NY_MAX * 2];
static okid_real_t dense_theta[NY_MAX * W_MAX], dense_innovation[NY_MAX * NY_MAX],
    dense_markov[(LAST + 1) * NY_MAX * 2];
static okid_observer_info_t info, dense_info;
static const okid_observer_config_t plain = {RIG_NU, RIG_NY, P, 0, 0};
// Between the solvers: rounding of the Gram matrix, or of a parameter where they are single precision.
static const double close_enough = sizeof(okid_real_t) == 8 ? 1e-12 : 2e-6;
// Of the radius: Arnoldi stops at 1e-7, or at what rounding moves an eigenvalue of a companion matrix in single precision.
static const double radius_accuracy = sizeof(okid_real_t) == 8 ? 1e-6 : 3e-5;

static void size_is(int inputs, int outputs, int count) {
    n_u = inputs;
    n_y = outputs;
    m = n_u + n_y;
    w = m * (P + 1);
    q = w - n_y;
    samples = count;
}

void setUp(void) {
    rig_make(&rig);
    size_is(RIG_NU, RIG_NY, N);
}
void tearDown(void) {}

/// Row of regressor k in [v_n; v_(n-1); ..]: the outputs of now are none.
static int row_of(int k) { return k < n_u ? k : k + n_y; }

/// The sums of rows first .. last - 1, into arrays as the solver wants them.
static okid_run_sums_t sum_rows(const double* v, int first, int last, double* its, double* before, double* end,
                                double* total) {
    memset(its, 0, (size_t)(m * w) * sizeof *its);
    memset(total, 0, (size_t)m * sizeof *total);
    for (int n = first; n < last; ++n)
        for (int k = 0; k < w; ++k)
            for (int r = 0; r < m; ++r) its[k * m + r] += v[n * m + r] * v[(n - k / m) * m + k % m];
    for (int n = first; n < last; ++n)
        for (int r = 0; r < m; ++r) total[r] += v[n * m + r];
    for (int a = 0; a < P; ++a) {
        memcpy(before + a * m, v + (first - 1 - a) * m, (size_t)m * sizeof *v);
        memcpy(end + a * m, v + (last - 1 - a) * m, (size_t)m * sizeof *v);
    }
    return (okid_run_sums_t){its, before, end, total, NULL, last - first};
}

static void sums_of(const double* v) { (void)sum_rows(v, P, samples, S, head, tail, sum); }

/// The Gram matrix by its definition, row by row of the record.
static void gram_of(const double* v, okid_detrend_t detrend) {
    static double mean[W_MAX];
    memset(gram, 0, sizeof gram);
    memset(mean, 0, sizeof mean);
    for (int n = P; n < samples && detrend == OKID_DETREND_MEAN; ++n)
        for (int k = 0; k < w; ++k) mean[k] += v[(n - k / m) * m + k % m] / (samples - P);
    for (int n = P; n < samples; ++n) {
        double row[W_MAX];
        for (int k = 0; k < w; ++k) row[k] = v[(n - k / m) * m + k % m] - mean[k];
        for (int j = 0; j < w; ++j)
            for (int i = 0; i < w; ++i) gram[j * w + i] += row[i] * row[j];
    }
}

static okid_status_t solve(const okid_observer_config_t* config, okid_detrend_t detrend) {
    const size_t bytes = okid_structured_memsize(config);
    char* work = malloc(bytes + 1);
    work[bytes] = 77; // the block ends here
    const okid_run_sums_t sums = {S, head, tail, sum, NULL, samples - P};
    const okid_status_t status = okid_structured_solve(config, detrend, &sums, theta, innovation, &info, work, bytes);
    TEST_ASSERT_EQUAL(77, work[bytes]);
    free(work);
    return status;
}

static okid_status_t solve_dense(const okid_observer_config_t* config) {
    const size_t bytes = okid_observer_memsize(config);
    void* work = malloc(bytes);
    const okid_status_t status =
        okid_observer_solve(config, gram, samples - P, dense_theta, dense_innovation, &dense_info, work, bytes);
    free(work);
    return status;
}

static void both(const double* v, const okid_observer_config_t* config, okid_detrend_t detrend) {
    sums_of(v);
    gram_of(v, detrend);
    TEST_ASSERT_EQUAL(OKID_OK, solve_dense(config));
    TEST_ASSERT_EQUAL(OKID_OK, solve(config, detrend));
    TEST_ASSERT_EQUAL(OKID_OK, okid_markov_recursion(n_u, n_y, P, theta, LAST, markov, NULL));
    TEST_ASSERT_EQUAL(OKID_OK, okid_markov_recursion(n_u, n_y, P, dense_theta, LAST, dense_markov, NULL));
}

static double distance(const okid_real_t* a, const okid_real_t* b, int count) {
    double worst = 0, size = 0;
    for (int k = 0; k < count; ++k) {
        worst = fmax(worst, fabs((double)a[k] - (double)b[k]));
        size = fmax(size, fabs((double)b[k]));
    }
    return worst / size;
}

static double markov_distance(void) { return distance(markov, dense_markov, (LAST + 1) * n_y * n_u); }

/// From the true Markov parameters.
static double markov_error(void) {
    double worst = 0, size = 0;
    for (int k = 0; k <= LAST; ++k) {
        double expected[RIG_NY];
        rig_markov(&rig, k, expected);
        for (int o = 0; o < RIG_NY; ++o) {
            worst = fmax(worst, fabs(expected[o] - (double)markov[k * RIG_NY + o]));
            size = fmax(size, fabs(expected[o]));
        }
    }
    return worst / size;
}

static void noise_gives_the_dense_solution(void) {
    const double noise[] = {0.05, 0.01};
    for (int k = 0; k < 2; ++k) {
        double* v = rig_record(&rig, N, noise[k], NULL, 5);
        both(v, &plain, OKID_DETREND_NONE);
        TEST_ASSERT_TRUE(markov_distance() < close_enough);
        const double sensitivity = 2.3e-16 * info.condition; // of the observer's own coefficients and the residual
        TEST_ASSERT_TRUE(distance(theta, dense_theta, n_y * q) < fmax(sensitivity, close_enough));
        TEST_ASSERT_TRUE(distance(innovation, dense_innovation, n_y * n_y) < fmax(sensitivity, 1e3 * close_enough));
        TEST_ASSERT_TRUE(fabs(info.radius - dense_info.radius) < radius_accuracy);
        TEST_ASSERT_EQUAL_DOUBLE(dense_info.ridge, info.ridge);
        TEST_ASSERT_TRUE(info.condition > dense_info.condition / 3 && info.condition < dense_info.condition * 3);
        free(v);
    }
}

// Offsets far above the signal: the lag rows' means are removed exactly, ends of the run included.
static void offsets_are_removed_as_from_the_rows(void) {
    double* v = rig_record(&rig, N, 0.01, NULL, 6);
    for (int n = 0; n < N; ++n)
        for (int c = 0; c < RIG_M; ++c) v[n * RIG_M + c] += 40 - 25 * c;
    both(v, &plain, OKID_DETREND_MEAN);
    const double lost = 40 * 40; // (offset / rms)^2: the digits that S had to give to it
    TEST_ASSERT_TRUE(markov_distance() < lost * close_enough);
    TEST_ASSERT_TRUE(distance(innovation, dense_innovation, n_y * n_y) <
                     fmax(2.3e-16 * lost * info.condition, 1e3 * close_enough));
    TEST_ASSERT_EQUAL(OKID_OK, solve(&plain, OKID_DETREND_NONE)); // and it matters
    TEST_ASSERT_EQUAL(OKID_OK, okid_markov_recursion(n_u, n_y, P, theta, LAST, markov, NULL));
    TEST_ASSERT_TRUE(markov_distance() > 1e-5);
    free(v);
}

// Trap 4: a structure that already moves; the samples before the first row carry it.
static void moving_start_needs_the_samples_before(void) {
    double x0[RIG_NZ];
    for (int i = 0; i < RIG_NZ; ++i) x0[i] = 300;
    double* v = rig_record(&rig, N, 0.01, x0, 3);
    both(v, &plain, OKID_DETREND_NONE);
    TEST_ASSERT_TRUE(markov_distance() < 1000 * close_enough);
    memset(head, 0, sizeof head); // eq. (38) as printed: what left at the end never came in, no Gram matrix
    TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC, solve(&plain, OKID_DETREND_NONE));
    free(v);
}

// Hardly more rows than unknowns: the ends of the run are a good part of every sum.
static void short_run_is_solved(void) {
    size_is(RIG_NU, RIG_NY, 200);
    double* v = rig_record(&rig, samples, 0.05, NULL, 11);
    for (int k = 0; k < 2; ++k) {
        both(v, &plain, k == 0 ? OKID_DETREND_NONE : OKID_DETREND_MEAN);
        TEST_ASSERT_TRUE(markov_distance() < fmax(2.3e-16 * info.condition, close_enough));
        TEST_ASSERT_TRUE(fabs(info.radius - dense_info.radius) < radius_accuracy);
    }
    free(v);
}

static const okid_observer_config_t many = {2, 5, P, 0, 0};

/// A record of two inputs and five outputs, with noise and offsets.
static double* many_channels(void) {
    size_is(2, 5, N);
    double *one = rig_record(&rig, N, 0, NULL, 12), *two = rig_record(&rig, N, 0, NULL, 13),
           *v = calloc(N * 7, sizeof *v);
    uint64_t state = 14;
    for (int n = 0; n < N; ++n) {
        v[n * 7] = one[n * RIG_M];
        v[n * 7 + 1] = two[n * RIG_M];
        for (int o = 0; o < 5; ++o)
            v[n * 7 + 2 + o] = one[n * RIG_M + 1 + o % 3] + (o - 1.5) * two[n * RIG_M + 1 + (o + 1) % 3] +
                               0.1 * rig_normal(&state) + o;
    }
    free(one);
    free(two);
    return v;
}

// More outputs than are solved at a time, a companion matrix of 100 states.
static void many_channels_are_solved(void) {
    double* v = many_channels();
    both(v, &many, OKID_DETREND_MEAN);
    TEST_ASSERT_TRUE(markov_distance() < close_enough);
    TEST_ASSERT_TRUE(distance(innovation, dense_innovation, n_y * n_y) <
                     fmax(2.3e-16 * info.condition, 1e3 * close_enough));
    TEST_ASSERT_TRUE(fabs(info.radius - dense_info.radius) < radius_accuracy);
    free(v);
}

// Trap 5: singular Gram matrix without noise.
static void noise_free_record_is_solved(void) {
    double* v = rig_record(&rig, N, 0, NULL, 3);
    both(v, &plain, OKID_DETREND_NONE);
    TEST_ASSERT_TRUE(info.condition > 1e11);
    TEST_ASSERT_TRUE(markov_error() < (sizeof(okid_real_t) == 8 ? 1e-9 : 1e-4));
    free(v);
}

// Codes of 16 and 24 bits without noise: condition 1e10 to 1e13.
static void quantised_codes_are_solved(void) {
    const double full[] = {32767, 8388607}, allowed[] = {1e-9, 1e-6};
    for (int k = 0; k < 2; ++k) {
        double *v = rig_record(&rig, N, 0, NULL, 4), peak = 0;
        for (int i = 0; i < N * RIG_M; ++i) peak = fmax(peak, fabs(v[i]));
        for (int i = 0; i < N * RIG_M; ++i) v[i] = round(v[i] / peak * full[k]);
        both(v, &plain, OKID_DETREND_MEAN);
        TEST_ASSERT_TRUE(markov_distance() < fmax(allowed[k], 10 * close_enough));
        free(v);
    }
}

// Trap 22: outputs behind a steep filter that the force does not see; the same ridge of the grid is found.
static void unstable_arx_is_stabilised_alike(void) {
    double *v = rig_record(&rig, N, 0, NULL, 9), *filtered = rig_filtered(v, N);
    both(filtered, &plain, OKID_DETREND_MEAN);
    TEST_ASSERT_TRUE(info.radius_plain > 1.1 && info.radius < 1);
    TEST_ASSERT_TRUE(info.ridge > 1e-12);
    TEST_ASSERT_EQUAL_DOUBLE(dense_info.ridge, info.ridge);
    TEST_ASSERT_TRUE(markov_distance() < 1e-3); // one scale a channel, not one a lag row, under a ridge that counts
    okid_observer_config_t leave = plain;
    leave.unstable = 1;
    const double before = info.radius_plain;
    TEST_ASSERT_EQUAL(OKID_OK, solve(&leave, OKID_DETREND_MEAN));
    TEST_ASSERT_EQUAL_DOUBLE(before, info.radius);
    free(v);
    free(filtered);
}

static void memory_grows_with_m_q(void) {
    for (int32_t inputs = 1; inputs <= 3; ++inputs)
        for (int32_t outputs = 1; outputs <= 10; outputs += 3)
            for (int32_t p = 5; p <= 160; p *= 2) {
                const okid_observer_config_t c = {inputs, outputs, p, 0, 0};
                const size_t ny = (size_t)outputs, ch = (size_t)inputs + ny, n = ch * (size_t)(p + 1);
                const size_t states = ny * (size_t)p, k = states < 64 ? states : 64;
                const size_t solver = 2 * (ch + 2) * (n + ch) + 12 * n + 2 * ch * ch + 16 * ch + 16;
                const size_t radius = (k + 1) * states + ny * states + 8 * k * k + 128 * k;
                TEST_ASSERT_TRUE(okid_structured_memsize(&c) <=
                                 sizeof(double) * (n + 2 * ch + (solver > radius ? solver : radius)) + 1024);
            }
    const okid_observer_config_t large = {3, 10, 160, 0, 0};
    TEST_ASSERT_TRUE(okid_structured_memsize(&large) * 20 < okid_observer_memsize(&large));
}

static void constant_and_dead_channels_are_named(void) {
    double* v = rig_record(&rig, N, 0.01, NULL, 2);
    for (int n = 0; n < N; ++n) v[n * RIG_M + 2] = 0.1;
    sums_of(v);
    TEST_ASSERT_EQUAL(OKID_ERR_OUTPUT, solve(&plain, OKID_DETREND_MEAN));
    TEST_ASSERT_EQUAL(2, info.channel);
    for (int n = 0; n < N; ++n) v[n * RIG_M] = 0;
    sums_of(v);
    TEST_ASSERT_EQUAL(OKID_ERR_INPUT, solve(&plain, OKID_DETREND_NONE));
    TEST_ASSERT_EQUAL(0, info.channel);
    free(v);
}

static void poor_excitation_is_refused(void) {
    double* v = rig_record(&rig, N, 0, NULL, 2);
    for (int n = 0; n < N; ++n) v[n * RIG_M] = sin(0.3 * n);
    sums_of(v);
    TEST_ASSERT_EQUAL(OKID_ERR_EXCITATION, solve(&plain, OKID_DETREND_NONE));
    TEST_ASSERT_TRUE(info.input_excitation < 1e-10);
    TEST_ASSERT_EQUAL(-1, info.channel);
    free(v);
    v = rig_record(&rig, N, 0.01, NULL, 2);
    for (int n = 0; n < N; ++n) v[n * RIG_M + 1] = -3 * v[n * RIG_M]; // two inputs, one cable
    sums_of(v);
    const okid_observer_config_t two = {2, 2, P, 0, 0};
    TEST_ASSERT_EQUAL(OKID_ERR_EXCITATION, solve(&two, OKID_DETREND_NONE));
    TEST_ASSERT_EQUAL(1, info.channel);
    free(v);
}

static void numbers_that_are_no_sums_are_refused(void) {
    double* v = rig_record(&rig, N, 0.01, NULL, 2);
    sums_of(v);
    S[RIG_M * RIG_M + 6] = 100 * S[0]; // a correlation above 1
    TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC, solve(&plain, OKID_DETREND_NONE));
    S[RIG_M * RIG_M + 6] = NAN;
    TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC, solve(&plain, OKID_DETREND_NONE));
    free(v);
}

static void wrong_use_is_refused(void) {
    const okid_observer_config_t bad = {0, 3, P, 0, 0};
    TEST_ASSERT_EQUAL(0, okid_structured_memsize(&bad));
    TEST_ASSERT_EQUAL(0, okid_structured_memsize(NULL));
    const okid_run_sums_t sums = {S, head, tail, NULL, NULL, N}, no_head = {S, NULL, tail, NULL, NULL, N},
                          few = {S, head, tail, NULL, NULL, q - 1};
    const size_t bytes = okid_structured_memsize(&plain);
    void* block = malloc(bytes);
    const struct {
        const okid_observer_config_t* config;
        okid_detrend_t detrend;
        const okid_run_sums_t* sums;
        size_t bytes;
        okid_status_t expected;
    } uses[] = {{&bad, OKID_DETREND_NONE, &sums, bytes, OKID_ERR_DIM},
                {&plain, OKID_DETREND_NONE, &sums, 16, OKID_ERR_MEMORY},
                {&plain, OKID_DETREND_MEAN, &sums, bytes, OKID_ERR_NULL},
                {&plain, OKID_DETREND_NONE, &no_head, bytes, OKID_ERR_NULL},
                {&plain, OKID_DETREND_NONE, &few, bytes, OKID_ERR_TOO_SHORT}};
    for (int k = 0; k < 5; ++k)
        TEST_ASSERT_EQUAL(uses[k].expected, okid_structured_solve(uses[k].config, uses[k].detrend, uses[k].sums, theta,
                                                                  NULL, &info, block, uses[k].bytes));
    free(block);
}

/// Solves G x = b for the regressors, G the Gram matrix: Gauss-Jordan with pivots, in `table` of q x (q + columns).
static void eliminate(double* table, int columns) {
    const int width = q + columns;
    for (int k = 0; k < q; ++k) {
        int best = k;
        for (int i = k + 1; i < q; ++i)
            if (fabs(table[i * width + k]) > fabs(table[best * width + k])) best = i;
        for (int j = 0; j < width; ++j) {
            const double swap = table[k * width + j];
            table[k * width + j] = table[best * width + j];
            table[best * width + j] = swap;
        }
        for (int i = 0; i < q; ++i) {
            const double factor = i == k ? 0 : table[i * width + k] / table[k * width + k];
            for (int j = k; j < width && i != k; ++j) table[i * width + j] -= factor * table[k * width + j];
        }
    }
    for (int k = 0; k < q; ++k)
        for (int j = q; j < width; ++j) table[k * width + j] /= table[k * width + k];
}

/// What leaving out rows first .. last - 1 does to theta by the rows themselves: -(sum of e v^T) (V V^T)^-1.
static void change_by_rows(const double* v, int first, int last, okid_detrend_t detrend, double* change) {
    double *table = calloc((size_t)(q * (q + n_y)), sizeof *table), mean[W_MAX] = {0};
    const int width = q + n_y;
    for (int n = P; n < samples && detrend == OKID_DETREND_MEAN; ++n)
        for (int k = 0; k < w; ++k) mean[k] += v[(n - k / m) * m + k % m] / (samples - P);
    for (int n = P; n < samples; ++n) {
        double row[W_MAX];
        for (int k = 0; k < w; ++k) row[k] = v[(n - k / m) * m + k % m] - mean[k];
        for (int i = 0; i < q; ++i)
            for (int j = 0; j < q; ++j) table[i * width + j] += row[row_of(i)] * row[row_of(j)];
        for (int o = 0; o < n_y && n >= first && n < last; ++o) {
            double e = row[n_u + o];
            for (int k = 0; k < q; ++k) e -= (double)theta[k * n_y + o] * row[row_of(k)];
            for (int i = 0; i < q; ++i) table[i * width + q + o] -= e * row[row_of(i)];
        }
    }
    eliminate(table, n_y);
    for (int k = 0; k < q; ++k)
        for (int o = 0; o < n_y; ++o) change[k * n_y + o] = table[k * width + q + o];
    free(table);
}

static void is_left_out_as_its_rows_are(const double* v, const okid_observer_config_t* config, okid_detrend_t detrend) {
    enum { PARTS = 3 };
    const int ends[PARTS + 1] = {P, 700, 2500, N};
    static double its[PARTS][M_MAX * W_MAX], before[PARTS][M_MAX * P], end[PARTS][M_MAX * P], total[PARTS][M_MAX],
        expected[NY_MAX * W_MAX];
    static okid_real_t change[PARTS * NY_MAX * W_MAX];
    sums_of(v);
    TEST_ASSERT_EQUAL(OKID_OK, solve(config, detrend));
    okid_run_sums_t part[PARTS];
    for (int b = 0; b < PARTS; ++b) part[b] = sum_rows(v, ends[b], ends[b + 1], its[b], before[b], end[b], total[b]);
    const okid_run_sums_t whole = {S, head, tail, sum, NULL, N - P};
    const size_t bytes = okid_structured_memsize(config);
    char* work = malloc(bytes + 1);
    work[bytes] = 77;
    TEST_ASSERT_EQUAL(OKID_OK, okid_structured_leave_out(config, detrend, &whole, info.ridge, theta, part, PARTS,
                                                         change, work, bytes));
    TEST_ASSERT_EQUAL(77, work[bytes]);
    free(work);
    for (int b = 0; b < PARTS; ++b) {
        double worst = 0, size = 0;
        change_by_rows(v, ends[b], ends[b + 1], detrend, expected);
        for (int k = 0; k < n_y * q; ++k) {
            worst = fmax(worst, fabs((double)change[b * n_y * q + k] - expected[k]));
            size = fmax(size, fabs(expected[k]));
        }
        TEST_ASSERT_TRUE(size > 0);
        TEST_ASSERT_TRUE(worst < size * (sizeof(okid_real_t) == 8 ? 1e-7 : 1e-2));
    }
}

static void part_left_out_changes_theta_as_its_rows_do(void) {
    double* v = rig_record(&rig, N, 0.05, NULL, 5);
    for (int n = 0; n < N; ++n)
        for (int c = 0; c < RIG_M; ++c) v[n * RIG_M + c] += 3 - c; // an offset
    for (int detrend = OKID_DETREND_NONE; detrend <= OKID_DETREND_MEAN; ++detrend)
        is_left_out_as_its_rows_are(v, &plain, (okid_detrend_t)detrend);
    free(v);
}

static void part_of_many_channels_is_left_out_alike(void) {
    double* v = many_channels();
    is_left_out_as_its_rows_are(v, &many, OKID_DETREND_MEAN);
    free(v);
}

static void wrong_parts_are_refused(void) {
    double* v = rig_record(&rig, N, 0.05, NULL, 5);
    sums_of(v);
    TEST_ASSERT_EQUAL(OKID_OK, solve(&plain, OKID_DETREND_NONE));
    const okid_run_sums_t whole = {S, head, tail, NULL, NULL, N - P}, no_tail = {S, head, NULL, NULL, NULL, N - P},
                          few = {S, head, tail, NULL, NULL, q - 1};
    const size_t bytes = okid_structured_memsize(&plain);
    static okid_real_t change[NY_MAX * W_MAX];
    char* work = malloc(bytes);
    const struct {
        const okid_run_sums_t *whole, *part;
        okid_detrend_t detrend;
        double ridge;
        int count;
        size_t bytes;
        okid_status_t expected;
    } uses[] = {{&whole, &whole, OKID_DETREND_NONE, 0, 0, bytes, OKID_OK},
                {&whole, &no_tail, OKID_DETREND_NONE, 0, 1, bytes, OKID_ERR_NULL},
                {&whole, &whole, OKID_DETREND_MEAN, 0, 1, bytes, OKID_ERR_NULL},
                {&whole, NULL, OKID_DETREND_NONE, 0, 1, bytes, OKID_ERR_NULL},
                {&whole, &whole, OKID_DETREND_NONE, -1, 1, bytes, OKID_ERR_DIM},
                {&whole, &whole, OKID_DETREND_NONE, (double)NAN, 1, bytes, OKID_ERR_DIM},
                {&whole, &whole, OKID_DETREND_NONE, 0, -1, bytes, OKID_ERR_DIM},
                {&whole, &whole, OKID_DETREND_NONE, 0, 1, bytes - 1, OKID_ERR_MEMORY},
                {&few, &whole, OKID_DETREND_NONE, 0, 1, bytes, OKID_ERR_TOO_SHORT}};
    for (size_t k = 0; k < sizeof uses / sizeof *uses; ++k)
        TEST_ASSERT_EQUAL(uses[k].expected,
                          okid_structured_leave_out(&plain, uses[k].detrend, uses[k].whole, uses[k].ridge, theta,
                                                    uses[k].part, uses[k].count, change, work, uses[k].bytes));
    S[RIG_M * RIG_M + 6] = 100 * S[0]; // a correlation above 1
    TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC, okid_structured_leave_out(&plain, OKID_DETREND_NONE, &whole, 0, theta, &whole,
                                                                  1, change, work, bytes));
    free(work);
    free(v);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(noise_gives_the_dense_solution);
    RUN_TEST(offsets_are_removed_as_from_the_rows);
    RUN_TEST(moving_start_needs_the_samples_before);
    RUN_TEST(short_run_is_solved);
    RUN_TEST(many_channels_are_solved);
    RUN_TEST(noise_free_record_is_solved);
    RUN_TEST(quantised_codes_are_solved);
    RUN_TEST(unstable_arx_is_stabilised_alike);
    RUN_TEST(memory_grows_with_m_q);
    RUN_TEST(constant_and_dead_channels_are_named);
    RUN_TEST(poor_excitation_is_refused);
    RUN_TEST(numbers_that_are_no_sums_are_refused);
    RUN_TEST(wrong_use_is_refused);
    RUN_TEST(part_left_out_changes_theta_as_its_rows_do);
    RUN_TEST(part_of_many_channels_is_left_out_alike);
    RUN_TEST(wrong_parts_are_refused);
    return UNITY_END();
}
