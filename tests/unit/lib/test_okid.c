// SPDX-License-Identifier: MIT
// Version and texts: every status has words of its own.
#include <ctype.h>
#include <math.h>
#include <okid/okid.h>
#include <string.h>
#include <unity.h>

static const okid_status_t all[] = {
    OKID_OK,           OKID_WARN_MISSING, OKID_WARN_SATURATED, OKID_WARN_MODEL,  OKID_ERR_NULL,
    OKID_ERR_DIM,      OKID_ERR_MEMORY,   OKID_ERR_MISMATCH,   OKID_ERR_RANGE,   OKID_ERR_TOO_SHORT,
    OKID_ERR_INPUT,    OKID_ERR_OUTPUT,   OKID_ERR_EXCITATION, OKID_ERR_NUMERIC, OKID_ERR_UNSTABLE,
    OKID_ERR_NO_MODES, OKID_ERR_FORMAT};
enum { COUNT = sizeof all / sizeof *all };

void setUp(void) {}
void tearDown(void) {}

static void every_status_has_words_of_its_own(void) {
    const char* unknown = okid_status_text((okid_status_t)-12345);
    TEST_ASSERT_EQUAL_STRING("unknown status", unknown);
    for (int i = 0; i < COUNT; ++i) {
        const char* text = okid_status_text(all[i]);
        TEST_ASSERT_TRUE(strcmp(text, unknown) != 0);
        for (int k = 0; k < i; ++k) TEST_ASSERT_TRUE(strcmp(text, okid_status_text(all[k])) != 0);
    }
    TEST_ASSERT_EQUAL_STRING("the memory block is too small", okid_status_text(OKID_ERR_MEMORY));
}

static void the_version_is_three_numbers(void) {
    int dots = 0;
    const char* text = okid_version();
    TEST_ASSERT_TRUE(isdigit((unsigned char)text[0]));
    for (const char* c = text; *c; ++c) {
        TEST_ASSERT_TRUE(*c == '.' || isdigit((unsigned char)*c));
        dots += *c == '.';
    }
    TEST_ASSERT_EQUAL_INT(2, dots);
}

/// A missing force counts as none, in the output and in the states.
static void a_missing_input_is_no_force(void) {
    const okid_real_t A[1] = {(okid_real_t)0.5}, B[1] = {1}, C[1] = {2}, D[1] = {3}, x0[1] = {4};
    const okid_model_t model = {.n_u = 1, .n_y = 1, .n_z = 1, .A = A, .B = B, .C = C, .D = D};
    const okid_real_t held[3] = {1, (okid_real_t)NAN, 2}, none[3] = {1, 0, 2};
    okid_real_t y[3], expected[3], work[4096];
    TEST_ASSERT_TRUE(okid_model_workspace(&model) <= sizeof work / sizeof *work);
    TEST_ASSERT_EQUAL(OKID_OK, okid_model_simulate(&model, none, 3, x0, expected, work));
    const okid_status_t status = okid_model_simulate(&model, held, 3, x0, y, work);
    TEST_ASSERT_TRUE(status >= 0);
    for (int n = 0; n < 3; ++n) TEST_ASSERT_TRUE(y[n] == expected[n]);
    TEST_ASSERT_TRUE(y[0] == 11 && y[1] == 6 && y[2] == 9); // 2*4 + 3*1; x = 3; x = 1.5, u = 2
}

static void no_initial_state_is_one_of_zeros(void) {
    const okid_real_t A[1] = {(okid_real_t)0.5}, B[1] = {1}, C[1] = {2}, D[1] = {3}, K[1] = {(okid_real_t)0.25};
    const okid_model_t model = {1, 1, 1, A, B, C, D, K};
    const okid_real_t u[3] = {1, 0, 2}, measured[3] = {4, 1, 3}, zero[1] = {0};
    okid_real_t simulated[2][3], predicted[2][3], work[4096];
    for (int given = 0; given < 2; ++given) {
        const okid_real_t* x0 = given ? zero : NULL;
        TEST_ASSERT_EQUAL(OKID_OK, okid_model_simulate(&model, u, 3, x0, simulated[given], work));
        TEST_ASSERT_EQUAL(OKID_OK, okid_model_predict(&model, u, measured, 3, x0, predicted[given], work));
    }
    for (int n = 0; n < 3; ++n) {
        TEST_ASSERT_TRUE(simulated[0][n] == simulated[1][n]);
        TEST_ASSERT_TRUE(predicted[0][n] == predicted[1][n]);
    }
    TEST_ASSERT_TRUE(simulated[0][0] == 3 && simulated[0][1] == 2 && simulated[0][2] == 7);
    TEST_ASSERT_TRUE(predicted[0][1] == 2 + 2 * (okid_real_t)0.25 * (4 - 3)); // x = B u + K (y - yhat)
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(every_status_has_words_of_its_own);
    RUN_TEST(the_version_is_three_numbers);
    RUN_TEST(a_missing_input_is_no_force);
    RUN_TEST(no_initial_state_is_one_of_zeros);
    return UNITY_END();
}
