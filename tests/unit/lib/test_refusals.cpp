// SPDX-License-Identifier: MIT
// Mechanics and models: without any one of the pointers that they need, with any one size or value out of range, the
// calls are refused. One mass on a spring goes through all of them.
#include "refusals.hpp"

#include <okid/mechanics.h>
#include <okid/mkr.h>
#include <okid/modal.h>
#include <okid/model.h>
#include <okid/steps/skew.h>
#include <okid/track.h>

#include <cmath>
#include <vector>

extern "C" void setUp() {}
extern "C" void tearDown() {}

namespace {

using real = okid_real_t;
using bytes_t = std::vector<unsigned char>;

const real one = 1, damper = 1, spring = 100;
const int32_t first[1] = {0}, accelerometer[1] = {OKID_SENSE_ACCELERATION};

/// x'' + x' + 100 x = u, y = x''; sampled 20 times a second with the force held.
struct mass_on_a_spring {
    real A[4], B[2], C[2], D[1], A_d[4], B_d[2], D_d[1], K[2] = {0, 0};
    okid_mechanics_t mechanics{1, 1, 1, &one, &damper, &spring, &one, nullptr, nullptr, &one};
    okid_model_t continuous{1, 1, 2, A, B, C, D, nullptr}, discrete{1, 1, 2, A_d, B_d, C, D_d, K};
    double dt = 0.05;

    mass_on_a_spring() {
        bytes_t work(okid_mechanics_memsize(1, 1)), more(okid_mechanics_hold_memsize(1, 1, 2));
        TEST_ASSERT_EQUAL(OKID_OK, okid_mechanics_continuous(&mechanics, A, B, C, D, work.data(), work.size()));
        TEST_ASSERT_EQUAL(OKID_OK,
                          okid_mechanics_c2d(&continuous, dt, OKID_HOLD_ZERO, A_d, B_d, D_d, more.data(), more.size()));
    }
};

void maps() {
    int32_t n_x = 2, n = 1, at = 0, kind = OKID_SENSE_VELOCITY;
    const int32_t *dof = &at, *sensing = &kind;
    real room[8], *B_a = room, *C_p = room + 2, *C_v = room + 4, *C_a = room + 6;
    const auto inputs = [&] { return okid_mechanics_inputs(n_x, n, dof, nullptr, B_a); };
    each_pointer_is_needed("inputs", inputs, {dof, B_a});
    each_size_has_a_least("inputs", inputs, {{&n_x, 1}, {&n, 1}});
    each_value_is_refused("inputs", inputs, at, {-1, 2});
    const auto outputs = [&] { return okid_mechanics_outputs(n_x, n, dof, nullptr, sensing, C_p, C_v, C_a); };
    each_pointer_is_needed("outputs", outputs, {dof, sensing, C_p, C_v, C_a});
    each_size_has_a_least("outputs", outputs, {{&n_x, 1}, {&n, 1}});
    each_value_is_refused("outputs", outputs, at, {-1, 2});
    each_value_is_refused("outputs", outputs, kind, {-1, 3});
}

void continuous_model_and_modes() {
    mass_on_a_spring s;
    okid_mechanics_t& m = s.mechanics;
    const okid_mechanics_t* self = &m;
    size_t bytes = okid_mechanics_memsize(1, 1);
    bytes_t block(bytes);
    void* work = block.data();
    real room[9], *A = room, *B = room + 4, *C = room + 6, *D = room + 8;
    const auto model = [&] { return okid_mechanics_continuous(self, A, B, C, D, work, bytes); };
    each_pointer_is_needed("continuous", model, {self, m.M, m.R, m.K, m.B_a, A, B, C, D, work});
    each_size_has_a_least("continuous", model, {{&m.n_x, 1}, {&m.n_u, 1}, {&m.n_y, 1}});
    every_byte_is_needed("continuous", model, bytes);
    okid_modes_t modes{};
    modes.frequency_hz = room;
    modes.damping_ratio = room + 1;
    modes.shape_re = room + 2;
    modes.shape_im = room + 3;
    okid_modes_t* to = &modes;
    const auto analyse = [&] { return okid_mechanics_modes(self, to, work, bytes); };
    each_pointer_is_needed(
        "modes", analyse,
        {self, m.M, m.K, to, modes.frequency_hz, modes.damping_ratio, modes.shape_re, modes.shape_im, work});
    each_size_has_a_least("modes", analyse, {{&m.n_x, 1}});
    every_byte_is_needed("modes", analyse, bytes);
}

void holds() {
    mass_on_a_spring s;
    size_t bytes = okid_mechanics_hold_memsize(1, 1, 2);
    bytes_t block(bytes);
    void* work = block.data();
    real room[7], *A = room, *B = room + 4, *D = room + 6;
    int32_t hold = OKID_HOLD_FIRST;
    const auto forward = [](auto... all) { return okid_mechanics_c2d(all...); };
    const auto backward = [](auto... all) { return okid_mechanics_d2c(all...); };
    const auto both = [&](const char* name, okid_model_t& m, const auto& way) {
        const okid_model_t* from = &m;
        const auto call = [&] { return way(from, s.dt, hold, A, B, D, work, bytes); };
        each_pointer_is_needed(name, call, {from, m.A, m.B, m.C, m.D, A, B, D, work});
        each_size_has_a_least(name, call, {{&m.n_u, 1}, {&m.n_y, 1}, {&m.n_z, 1}});
        each_value_is_refused(name, call, hold, {-1, 2});
        each_value_is_refused(name, call, s.dt, {0.0, -1.0, std::nan(""), double(INFINITY)});
        every_byte_is_needed(name, call, bytes);
    };
    both("c2d", s.continuous, forward);
    both("d2c", s.discrete, backward);
}

void modes_of_a_model() {
    mass_on_a_spring s;
    okid_model_t& m = s.discrete;
    const okid_model_t* model = &m;
    size_t bytes = okid_modal_memsize(1, 2);
    bytes_t block(bytes);
    void* work = block.data();
    real room[3];
    okid_modes_t modes{};
    modes.mpc = room;
    modes.shape_re = room + 1;
    modes.shape_im = room + 2;
    okid_modes_t* to = &modes;
    const auto analyse = [&] { return okid_modal_analyse(model, s.dt, to, work, bytes); };
    each_pointer_is_needed("modal", analyse, {model, m.A, m.C, to, modes.shape_re, modes.shape_im, work});
    each_size_has_a_least("modal", analyse, {{&m.n_y, 1}, {&m.n_z, 1}});
    each_value_is_refused("modal", analyse, s.dt, {0.0, -1.0, std::nan("")});
    every_byte_is_needed("modal", analyse, bytes);
    modes.shape_re = modes.shape_im = nullptr; // MPC is that of the shapes
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, analyse());
    modes.mpc = nullptr;
    TEST_ASSERT_EQUAL(OKID_OK, analyse());
}

void a_shape_that_is_not_there_is_like_none() {
    const real shape[2] = {1, 2};
    TEST_ASSERT_EQUAL_DOUBLE(1, okid_modal_mac(2, shape, shape, shape, shape));
    for (int k = 0; k < 4; ++k)
        TEST_ASSERT_EQUAL_DOUBLE(0, okid_modal_mac(2, k == 0 ? nullptr : shape, k == 1 ? nullptr : shape,
                                                   k == 2 ? nullptr : shape, k == 3 ? nullptr : shape));
}

void mass_damping_and_stiffness() {
    mass_on_a_spring s;
    okid_model_t& m = s.discrete;
    const okid_model_t* model = &m;
    okid_mkr_config_t c = okid_mkr_defaults(1, s.dt);
    int32_t drives = 0, shows = 0, kind = OKID_SENSE_ACCELERATION;
    real force = 1, motion = 1;
    c.input_dof = &drives;
    c.output_dof = &shows;
    c.output_sensing = &kind;
    c.input_gain = &force;
    c.output_gain = &motion;
    const okid_mkr_config_t* config = &c;
    okid_mkr_t found{}, *result = &found;
    size_t bytes = okid_mkr_memsize(1, 1, 2, 1);
    bytes_t block(bytes);
    void* work = block.data();
    const auto identify = [&] { return okid_mkr_identify(model, config, result, work, bytes); };
    each_pointer_is_needed(
        "mkr", identify,
        {model, m.A, m.B, m.C, m.D, config, c.input_dof, c.output_dof, c.output_sensing, result, work});
    each_size_has_a_least("mkr", identify, {{&m.n_u, 1}, {&m.n_y, 1}, {&m.n_z, 1}, {&c.n_x, 1}});
    each_value_is_refused("mkr", identify, c.hold, {-1, 2});
    each_value_is_refused("mkr", identify, c.dt, {0.0, -1.0, std::nan(""), double(INFINITY)});
    each_value_is_refused("mkr", identify, drives, {-2, 1});
    each_value_is_refused("mkr", identify, shows, {-2, 1});
    each_value_is_refused("mkr", identify, kind, {-1, 3});
    each_value_is_refused("mkr", identify, force, {real(0), real(NAN), real(INFINITY)});
    each_value_is_refused("mkr", identify, motion, {real(0), real(NAN), real(INFINITY)});
    every_byte_is_needed("mkr", identify, bytes);
}

void proportional_damping() {
    int32_t count = 2, n_x = 1;
    real frequency[2] = {1, 3}, ratio[2] = {real(0.01), real(0.02)}, weight[2] = {1, 2};
    const real *f = frequency, *zeta = ratio, *w = weight;
    okid_pdc_t fit{}, *pdc = &fit;
    const auto call = [&] { return okid_pdc_fit(count, f, zeta, w, pdc); };
    each_pointer_is_needed("pdc_fit", call, {f, zeta, pdc});
    each_size_has_a_least("pdc_fit", call, {{&count, 1}});
    for (int k = 0; k < 2; ++k) {
        each_value_is_refused("pdc_fit", call, frequency[k], {real(0), real(-1), real(NAN), real(INFINITY)});
        each_value_is_refused("pdc_fit", call, ratio[k], {real(NAN), real(INFINITY)});
        each_value_is_refused("pdc_fit", call, weight[k], {real(-1), real(NAN), real(INFINITY)});
    }
    weight[0] = 0; // one mode alone may carry all
    each_value_is_refused("pdc_fit", call, weight[1], {real(0)});
    real damping = 0, *R = &damping;
    const real *M = &one, *K = &spring;
    const okid_pdc_t* by = &fit;
    const auto damp = [&] { return okid_pdc_damping(n_x, by, M, K, R); };
    each_pointer_is_needed("pdc_damping", damp, {by, M, K, R});
    each_size_has_a_least("pdc_damping", damp, {{&n_x, 1}});
}

void models_at_work() {
    mass_on_a_spring s;
    okid_model_t& m = s.discrete;
    const okid_model_t* model = &m;
    const real force[4] = {1, 0, 2, 0}, measured[4] = {0, 1, 0, 1}, *u = force, *y = measured;
    real out[4], state[2], *to = out, *x0 = state;
    std::vector<real> room(okid_model_workspace(model));
    real* work = room.data();
    const std::initializer_list<least_of> sizes = {{&m.n_u, 0}, {&m.n_y, 1}, {&m.n_z, 1}};
    const auto simulate = [&] { return okid_model_simulate(model, u, 4, nullptr, to, work); };
    each_pointer_is_needed("simulate", simulate, {model, u, to, work});
    each_size_has_a_least("simulate", simulate, sizes);
    const auto predict = [&] { return okid_model_predict(model, u, y, 4, nullptr, to, work); };
    each_pointer_is_needed("predict", predict, {model, m.K, u, y, to, work});
    each_size_has_a_least("predict", predict, sizes);
    const auto begin = [&] { return okid_model_initial_state(model, u, y, 4, x0, work); };
    each_pointer_is_needed("initial_state", begin, {model, u, y, x0, work});
    each_size_has_a_least("initial_state", begin, sizes);
    const double samples[8] = {1, 0, 0, 1, 2, 0, 0, 1}, *rows = samples;
    double squares[5] = {0}, *sums = squares;
    size_t bytes = okid_model_fit_memsize(model);
    bytes_t block(bytes);
    void* fit_work = block.data();
    const auto fit = [&] { return okid_model_fit(model, rows, 4, nullptr, sums, fit_work, bytes); };
    each_pointer_is_needed("fit", fit, {model, rows, sums, fit_work});
    each_size_has_a_least("fit", fit, sizes);
    every_byte_is_needed("fit", fit, bytes);
    TEST_ASSERT_EQUAL_UINT64(0, okid_model_workspace(nullptr));
}

void followed_modes() {
    okid_track_config_t c = okid_track_defaults(1, 2);
    const okid_track_config_t* config = &c;
    okid_tracks_t *tracks = nullptr, **self = &tracks;
    size_t bytes = okid_track_memsize(&c);
    bytes_t room(bytes);
    void* block = room.data();
    const auto create = [&] { return okid_track_create(self, config, block, bytes); };
    each_pointer_is_needed("track_create", create, {self, config, block});
    each_size_has_a_least("track_create", create,
                          {{&c.n_y, 1}, {&c.max_modes, 1}, {&c.max_tracks, 1}, {&c.born, 0}, {&c.dies, 0}});
    each_value_is_refused("track_create", create, c.frequency, {-0.1, 1.0, std::nan("")});
    each_value_is_refused("track_create", create, c.jump, {-0.1, 1.0, std::nan("")});
    each_value_is_refused("track_create", create, c.mac, {-0.1, 1.0, std::nan("")});
    each_value_is_refused("track_create", create, c.close_hz, {-0.1, std::nan("")});
    each_value_is_refused("track_create", create, c.n_y, {4097});
    each_value_is_refused("track_create", create, c.max_modes, {4097});
    each_value_is_refused("track_create", create, c.max_tracks, {4097});
    every_byte_is_needed("track_create", create, bytes);
    real frequency[2] = {1, 2}, other[2] = {1, 1}, *f = frequency, *zeta = other, *re = other, *im = other;
    int32_t numbers[2], *number = numbers, count = 2, k = 0;
    const auto update = [&] { return okid_track_update(tracks, count, f, zeta, re, im, number); };
    each_pointer_is_needed("track_update", update, {tracks, f, zeta, re, im, number});
    each_size_has_a_least("track_update", update, {{&count, 0}});
    each_value_is_refused("track_update", update, count, {3});
    each_value_is_refused("track_update", update, frequency[1], {real(0), real(-1), real(NAN), real(INFINITY)});
    okid_track_t known{}, *out = &known;
    const auto get = [&] { return okid_track_get(tracks, k, out); };
    each_pointer_is_needed("track_get", get, {tracks, out});
    each_value_is_refused("track_get", get, k, {-1, okid_track_count(tracks)});
    okid_track_jump(nullptr);
    TEST_ASSERT_EQUAL(0, okid_track_count(nullptr));
}

void delays() {
    mass_on_a_spring s;
    okid_model_t& m = s.discrete;
    const okid_model_t* model = &m;
    okid_mkr_config_t mkr = okid_mkr_defaults(1, s.dt);
    mkr.input_dof = mkr.output_dof = first;
    mkr.output_sensing = accelerometer;
    okid_skew_config_t c = okid_skew_defaults(1, 1, 2, &mkr);
    const okid_skew_config_t* config = &c;
    okid_skew_t *skew = nullptr, **self = &skew;
    size_t bytes = okid_skew_memsize(&c);
    bytes_t room(bytes);
    void* block = room.data();
    const auto create = [&] { return okid_skew_create(self, config, block, bytes); };
    each_pointer_is_needed("skew_create", create, {self, config, block});
    each_size_has_a_least("skew_create", create,
                          {{&c.n_u, 1}, {&c.n_y, 1}, {&c.n_z, 1}, {&c.replicates, 2}, {&mkr.n_x, 1}});
    each_value_is_refused("skew_create", create, c.replicates, {65});
    each_value_is_refused<const int32_t*>("skew_create", create, mkr.output_sensing, {nullptr});
    every_byte_is_needed("skew_create", create, bytes);
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, okid_skew_add(skew, model)); // of no model
    const auto begin = [&] { return okid_skew_begin(skew, model); };
    const auto add = [&] { return okid_skew_add(skew, model); };
    each_pointer_is_needed("skew_begin", begin, {skew, model});
    each_pointer_is_needed("skew_add", add, {skew, model});
    for (int32_t* size : {&m.n_u, &m.n_y, &m.n_z}) {
        TEST_ASSERT_TRUE(begin() >= 0);
        ++*size;
        TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, add());
        TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, begin());
        --*size;
    }
    okid_skew_result_t found{}, *result = &found;
    const auto finish = [&] { return okid_skew_finish(skew, result); };
    TEST_ASSERT_TRUE(begin() >= 0);
    TEST_ASSERT_EQUAL(OKID_OK, add());
    TEST_ASSERT_EQUAL(OKID_ERR_TOO_SHORT, finish()); // one says nothing of deviations
    TEST_ASSERT_EQUAL(OKID_OK, add());
    real row[2], direct[1], *C = row, *D = direct;
    const auto correct = [&] { return okid_skew_correct(skew, C, D); };
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, correct()); // before the delays are known
    each_pointer_is_needed("skew_finish", finish, {skew, result});
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, add()); // after them
    for (pointer_at one_of : {pointer_at(skew), pointer_at(C), pointer_at(D)}) {
        void *kept = nullptr, *const none = nullptr;
        std::memcpy(&kept, one_of.place, sizeof kept);
        std::memcpy(one_of.place, &none, sizeof none);
        TEST_ASSERT_EQUAL(OKID_ERR_NULL, correct());
        std::memcpy(one_of.place, &kept, sizeof kept);
    }
    TEST_ASSERT_EQUAL(OKID_OK, correct());
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, correct());                                                  // once
    for (int k = 0; k < 2; ++k) TEST_ASSERT_TRUE(std::abs(C[k] - s.C[k]) < 1e-10 * std::abs(s.C[0])); // nothing is late
    TEST_ASSERT_TRUE(D[0] == s.D_d[0]);
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(maps);
    RUN_TEST(continuous_model_and_modes);
    RUN_TEST(holds);
    RUN_TEST(modes_of_a_model);
    RUN_TEST(a_shape_that_is_not_there_is_like_none);
    RUN_TEST(mass_damping_and_stiffness);
    RUN_TEST(proportional_damping);
    RUN_TEST(models_at_work);
    RUN_TEST(followed_modes);
    RUN_TEST(delays);
    return UNITY_END();
}
