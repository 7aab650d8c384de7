// SPDX-License-Identifier: MIT
// Modes of hits at several places: what one place repeats is a mode's, what has another phase in each hit is none; and a mode
// that is doubtful keeps its motion for itself.
#include "narrow_bands.hpp"
#include "record/place_shapes.hpp"
#include "record/roving.hpp"

#include <cmath>
#include <complex>
#include <unity.h>
#include <vector>

using namespace okid_host;

void setUp() {}
void tearDown() {}

namespace {

constexpr std::size_t count = 512, places = 5, hits_each = 3, hit_at = 20;
constexpr double noise = 1e-3;

/// A mode that the hits drive; its entry at each place.
struct driven_mode {
    listed_mode mode;
    std::vector<double> at;
};

/// One sensor that is at none of the places, and a vibration that goes on through all records.
struct hammer_test {
    record_work work;
    record_options options;

    hammer_test(const std::vector<driven_mode>& modes, const listed_mode& hum, double hum_size) {
        std::mt19937 random(11);
        std::normal_distribution<double> normal;
        std::uniform_real_distribution<double> phase(0, 2 * M_PI);
        work.set.n_u = work.set.n_y = 1;
        options.fs_hz = sample_rate;
        options.inputs = {"hammer"};
        options.outputs = {"a"};
        options.placed.inputs.resize(1);
        options.placed.outputs.resize(1);
        for (std::size_t j = 0; j < places; ++j)
            for (std::size_t n = 0; n < hits_each; ++n) {
                series rows(2 * count);
                for (std::size_t t = hit_at; t < hit_at + 3; ++t) rows[2 * t] = 1.0 + 0.1 * static_cast<double>(n);
                const double turned = phase(random);
                for (std::size_t t = 0; t < count; ++t)
                    rows[2 * t + 1] =
                        noise * normal(random) +
                        hum_size *
                            std::cos(2 * M_PI * hum.frequency_hz / sample_rate * static_cast<double>(t) + turned);
                for (const driven_mode& one : modes) {
                    std::complex<double> state = 0;
                    for (std::size_t t = 0; t < count; ++t) {
                        rows[2 * t + 1] += (one.mode.shape[0] * state).real();
                        state = discrete_pole(one.mode, 1 / sample_rate) * state +
                                std::complex<double>(0, one.at[j]) * rows[2 * t];
                    }
                }
                work.set.add("", rows.data(), count);
                options.hits.push_back(static_cast<int>(j) + 1);
            }
    }
};

double mac_with(const std::vector<double>& truth, const placed_shapes& shapes, std::size_t k) {
    std::complex<double> both = 0;
    double own = 0, other = 0;
    for (std::size_t j = 0; j < truth.size(); ++j) {
        const std::complex<double> entry(shapes.re[k * truth.size() + j], shapes.im[k * truth.size() + j]);
        both += entry * truth[j];
        own += std::norm(entry);
        other += truth[j] * truth[j];
    }
    return std::norm(both) / (own * other);
}

const std::vector<double> first_shape = {1, 0.8, 0.3, -0.4, -0.9}, second_shape = {0.9, -0.5, -1, -0.2, 0.8};

void a_hum_is_no_mode() {
    for (const double size : {0.003, 0.03, 0.1}) {
        const driven_mode driven{{18, 0.01, 1, 1, {1}, true}, first_shape};
        std::vector<listed_mode> listed = {driven.mode, {50, 0.0005, 1, 1, {1}, true}};
        hammer_test test({driven}, listed[1], size);
        test.work.context.verdicts = {{true, 0.8, {}}, {true, 0.8, {}}};
        doubt_scattered(test.options.hits, sample_rate, test.work.set, listed, test.work.context.verdicts);
        TEST_ASSERT_TRUE(listed[0].in_model && test.work.context.verdicts[0].confident);
        TEST_ASSERT_TRUE(test.work.context.verdicts[0].why.empty());
        TEST_ASSERT_FALSE(listed[1].in_model || test.work.context.verdicts[1].confident);
        TEST_ASSERT_EQUAL_STRING("noise_shape", test.work.context.verdicts[1].why.at(0).c_str());
    }
}

void one_hit_a_place_says_nothing_against_a_mode() {
    const driven_mode driven{{18, 0.01, 1, 1, {1}, true}, first_shape};
    std::vector<listed_mode> listed = {driven.mode, {50, 0.0005, 1, 1, {1}, true}};
    hammer_test test({driven}, listed[1], 0.1);
    record_work single;
    single.set.n_u = single.set.n_y = 1;
    single.context.verdicts = {{true, 0.8, {}}, {true, 0.8, {}}};
    std::vector<int> hits;
    for (std::size_t r = 0; r < test.options.hits.size(); r += hits_each) {
        single.set.add("", test.work.set.rows(test.work.set.records[r]), count);
        hits.push_back(test.options.hits[r]);
    }
    doubt_scattered(hits, sample_rate, single.set, listed, single.context.verdicts);
    TEST_ASSERT_TRUE(listed[0].in_model && listed[1].in_model);
}

/// Every other hit of a place was elsewhere: of no mode is that said.
void hits_of_other_places_say_nothing_against_modes() {
    const driven_mode first{{18, 0.01, 1, 1, {1}, true}, first_shape},
        second{{33, 0.01, 1, 1, {1}, true}, second_shape};
    std::vector<listed_mode> listed = {first.mode, second.mode};
    hammer_test test({first, second}, {50, 0.0005, 1, 1, {1}, false}, 0);
    for (int& place : test.options.hits) place = 1;
    test.work.context.verdicts = {{true, 0.8, {}}, {true, 0.8, {}}};
    doubt_scattered(test.options.hits, sample_rate, test.work.set, listed, test.work.context.verdicts);
    TEST_ASSERT_TRUE(listed[0].in_model && listed[1].in_model);
}

/// Their half-power bands overlap; alone, the first would take what the second moves.
void a_doubtful_mode_keeps_its_motion() {
    const driven_mode first{{18, 0.04, 1, 1, {1}, true}, first_shape},
        second{{19.5, 0.04, 1, 1, {1}, false}, second_shape};
    std::vector<listed_mode> listed = {first.mode, second.mode};
    hammer_test test({first, second}, {50, 0.0005, 1, 1, {1}, false}, 0);
    test.work.context.verdicts = {{true, 0.8, {}}, {false, 0.6, {"noise_shape"}}};
    test.work.refined = std::make_unique<refined_arrays>();
    for (auto* array : {&test.work.refined->mpc, &test.work.refined->cmi, &test.work.refined->emac})
        array->assign(2, 1);
    place_shapes(listed, test.options, test.work);
    TEST_ASSERT_TRUE(mac_with(first_shape, *test.work.context.placed, 0) > 0.999);
    TEST_ASSERT_TRUE(mac_with(second_shape, *test.work.context.placed, 1) > 0.999);
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(a_hum_is_no_mode);
    RUN_TEST(one_hit_a_place_says_nothing_against_a_mode);
    RUN_TEST(hits_of_other_places_say_nothing_against_modes);
    RUN_TEST(a_doubtful_mode_keeps_its_motion);
    return UNITY_END();
}
