// SPDX-License-Identifier: MIT
// One structure with two forces and a sensor on every degree of freedom, for the tests of mechanics.h.
#ifndef OKID_TEST_MECHANICS_RIG_H
#define OKID_TEST_MECHANICS_RIG_H

#include "structures.h"

#include <unity.h>

static structure_t s;
static system_t m, c; // discrete or continuous model under test, and its continuous original
static const double pi = 3.14159265358979323846;

void setUp(void) {}
void tearDown(void) {}

static void assert_near(double expected, double relative, double found) {
    TEST_ASSERT_DOUBLE_WITHIN(relative * fabs(expected), expected, found);
}

/// Structure `which`, two forces, a sensor of kind `first` + i on degree i (mod 3 kinds), continuous in c and m.
static void make(int which, int first, int mixed) {
    const int32_t forces[] = {0, 2};
    int32_t dof[S_MAX], kind[S_MAX];
    s_make(&s, which);
    for (int i = 0; i < s.n; ++i) {
        dof[i] = i;
        kind[i] = mixed ? (first + i) % 3 : first;
    }
    s_instrument(&m, 2, forces, s.n, dof, kind);
    TEST_ASSERT_EQUAL(OKID_OK, s_continuous(&s, &m));
    c = m;
}

#endif
