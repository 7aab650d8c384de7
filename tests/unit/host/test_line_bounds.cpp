// SPDX-License-Identifier: MIT
// Each number that tells a line from a mode, from both sides: amplitudes that scatter by so much, parts of the rate, mains, and
// multiples of a stronger vibration.
#include "consensus/lines.hpp"
#include "narrow_bands.hpp"

#include <functional>
#include <tuple>
#include <unity.h>

using namespace okid_host;

namespace {

record_level level_of(const std::vector<series>& outputs) {
    record_level out;
    out.fs_hz = sample_rate;
    out.top = 0.48;
    out.records.push_back(record_of(outputs).samples);
    out.samples = static_cast<long long>(outputs[0].size());
    return out;
}

consensus_mode found_at(double frequency_hz, double damping_ratio, std::vector<std::complex<double>> of = {1.0}) {
    consensus_mode out;
    out.frequency_hz = frequency_hz;
    out.damping_ratio = damping_ratio;
    out.agreement = 1;
    out.shape = std::move(of);
    return out;
}

/// The codes of the last mode, separated by spaces.
std::string why(const std::vector<series>& outputs, std::vector<consensus_mode> modes) {
    mark_lines({level_of(outputs)}, 0, outputs.size(), false, modes);
    std::string out;
    for (const std::string& code : modes.back().why) out += (out.empty() ? "" : " ") + code;
    return out;
}

/// A sine whose amplitude follows a law of the block, 64 of them.
series sine(double hz, std::size_t count, const std::function<double(std::size_t)>& amplitude) {
    series out(count);
    for (std::size_t t = 0; t < count; ++t)
        out[t] = amplitude(t / (count / 64)) * std::sin(2 * M_PI * hz / sample_rate * static_cast<double>(t));
    return out;
}

double constant(std::size_t) { return 1; }

constexpr std::size_t usual = 64 * 512;

/// Of a strong vibration of 10 Hz and a weak one at n times that, so much of whose amplitude is the n-th power of the first's.
std::string why_of_multiple(int n, double share, double size, double listed_hz, double agreement = 1) {
    const std::size_t count = 60'000;
    const analytic first = chance_amplitude(count, 10, 0.003, 1), other = chance_amplitude(count, 10 * n, 0.003, 2);
    analytic second(count);
    double power = 0;
    for (std::size_t t = 0; t < count; ++t) power += std::norm(std::pow(first[t], n)) / static_cast<double>(count);
    for (std::size_t t = 0; t < count; ++t)
        second[t] = share * std::pow(first[t], n) / std::sqrt(power) + std::sqrt(1 - share * share) * other[t];
    series out = white(count, 1e-4, 3);
    add(out, 1, turning_at(10, first));
    add(out, size, turning_at(10 * n, second));
    std::vector<consensus_mode> modes = {found_at(10, 0.003), found_at(listed_hz, 0.003)};
    modes[0].agreement = agreement;
    return why({out}, modes);
}

} // namespace

void setUp() {}
void tearDown() {}

/// A quarter of its mean; noise in a narrow band scatters by a half.
static void an_amplitude_that_hardly_scatters_is_a_line() {
    for (const double spread : {0.23, 0.27}) {
        const series out = sine(20, usual, [spread](std::size_t block) { return block % 2 ? 1 + spread : 1 - spread; });
        TEST_ASSERT_EQUAL_STRING(spread < 0.25 ? "tone" : "", why({out}, {found_at(20, 0.0005)}).c_str());
    }
    series chance = white(usual, 1e-3, 1);
    add(chance, 1, turning_at(20, chance_amplitude(usual, 20, 0.005, 2)));
    TEST_ASSERT_EQUAL_STRING("", why({chance}, {found_at(20, 0.005)}).c_str());
}

/// In a record too short to tell whether it wanders.
static void what_is_damped_more_than_a_hundredth_is_no_line() {
    const series out = sine(20, 2'900, constant);
    TEST_ASSERT_EQUAL_STRING("tone", why({out}, {found_at(20, 0.0099)}).c_str());
    TEST_ASSERT_EQUAL_STRING("", why({out}, {found_at(20, 0.0101)}).c_str());
}

constexpr double wide = 0.0101;          ///< damping of a tone that wanders
constexpr std::size_t width_of_it = 202; ///< samples of a block as short as half the reciprocal of its width

/// A sine of 20 Hz whose amplitude is so much more for eight blocks and less for eight, so many in all: few blocks of any size
/// have both.
static series in_steps(double spread, std::size_t blocks) {
    series out(width_of_it * blocks);
    for (std::size_t t = 0; t < out.size(); ++t)
        out[t] = (1 + (t / width_of_it / 8 % 2 ? spread : -spread)) *
                 std::sin(2 * M_PI * 20 / sample_rate * static_cast<double>(t));
    return out;
}

/// 0.3 in long records, 2 / sqrt(blocks) below what chance gives in short ones.
static void an_amplitude_that_stays_in_blocks_as_short_as_its_width_is_a_tone() {
    for (const auto& [spread, blocks, code] :
         {std::tuple{0.29, 400, "tone"}, {0.31, 400, ""}, {0.26, 64, "tone"}, {0.28, 64, ""}})
        TEST_ASSERT_EQUAL_STRING(
            code, why({in_steps(spread, static_cast<std::size_t>(blocks))}, {found_at(20, wide)}).c_str());
}

/// Blows of a pile driver, nearly even: in blocks of one blow each a mode's amplitude stays, but not as that of a tone does.
static void a_mode_under_even_blows_is_no_tone() {
    std::mt19937 random(8);
    std::normal_distribution<double> normal;
    series out = white(usual, 0.01, 9);
    for (double at = 0.2; at * sample_rate < static_cast<double>(usual); at += 1.45 * (1 + 0.07 * normal(random))) {
        const double strength = 1 + 0.25 * normal(random), omega = 2 * M_PI * 20;
        for (auto t = static_cast<std::size_t>(at * sample_rate) + 1; t < out.size(); ++t) {
            const double since = static_cast<double>(t) / sample_rate - at;
            if (wide * omega * since > 12) break;
            out[t] += strength * std::exp(-wide * omega * since) * std::sin(omega * since);
        }
    }
    TEST_ASSERT_EQUAL_STRING("", why({out}, {found_at(20, wide)}).c_str());
}

static void a_tone_that_wanders_is_no_mode() {
    std::mt19937 random(4);
    std::normal_distribution<double> normal;
    series tone = white(usual, 0.01, 5), chance = white(usual, 0.01, 5);
    double away = 0, phase = 0;
    for (double& x : tone) {
        away = 0.998 * away + 0.0006 * normal(random); // 1 % of its frequency, for two seconds
        phase += 2 * M_PI * 20 * (1 + away) / sample_rate;
        x += std::sin(phase);
    }
    add(chance, 1, turning_at(20, chance_amplitude(usual, 20, wide, 2)));
    TEST_ASSERT_EQUAL_STRING("tone", why({tone}, {found_at(20, wide)}).c_str());
    TEST_ASSERT_EQUAL_STRING("", why({chance}, {found_at(20, wide)}).c_str());
}

/// What a tone shows that wanders far is two poles, at the ends of its way: it comes by both. A chance vibration does not keep
/// its amplitude, and a tone that stays where it is does not come by.
static void the_ends_of_a_tones_way_are_no_modes() {
    std::mt19937 random(6);
    std::normal_distribution<double> normal;
    series tone = white(usual, 0.01, 5);
    double away = 0, phase = 0;
    for (double& x : tone) {
        away = 0.9995 * away + 0.0006 * normal(random); // 2 % of its frequency, for eight seconds
        phase += 2 * M_PI * 20 * (1 + away) / sample_rate;
        x += std::sin(phase);
    }
    for (const double end_hz : {19.5, 20.5})
        TEST_ASSERT_EQUAL_STRING("tone", why({tone}, {found_at(20, 0.0005), found_at(end_hz, wide)}).c_str());
    series stays = sine(20, usual, [](std::size_t) { return 3; });
    for (const double end_hz : {19.5, 20.5}) {
        series beside = stays;
        add(beside, 1, turning_at(end_hz, chance_amplitude(usual, end_hz, wide, 2)));
        TEST_ASSERT_EQUAL_STRING("", why({beside}, {found_at(20, 0.0005), found_at(end_hz, wide)}).c_str());
    }
}

/// Ten times as strong, listed or not.
static void a_mode_beside_a_tone_stays() {
    series out = sine(20.8, usual, [](std::size_t) { return 10; });
    add(out, 1, turning_at(20, chance_amplitude(usual, 20, wide, 2)));
    TEST_ASSERT_EQUAL_STRING("", why({out}, {found_at(20, wide)}).c_str());
    TEST_ASSERT_EQUAL_STRING("", why({out}, {found_at(20.8, 0.0005), found_at(20, wide)}).c_str());
    out = sine(20.1, usual, [](std::size_t) { return 10; }); // within its width: only what is listed helps
    add(out, 1, turning_at(20, chance_amplitude(usual, 20, wide, 2)));
    TEST_ASSERT_EQUAL_STRING("", why({out}, {found_at(20.1, 0.0005), found_at(20, wide)}).c_str());
}

/// Eight blocks of eight periods: 2,049 samples at 1 Hz.
static void eight_blocks_show_a_spread() {
    for (const std::size_t count : {8 * 2049, 8 * 2049 - 1})
        TEST_ASSERT_EQUAL_STRING(count % 2049 == 0 ? "tone" : "",
                                 why({sine(1, count, constant)}, {found_at(1, 0.0099)}).c_str());
}

/// At the lowest rate that shows it, no narrow band: 0.42 of 128 and of 64 a second are 53.76 and 26.88 Hz.
static void a_vibration_is_looked_at_where_it_takes_the_fewest_samples() {
    constexpr std::size_t count = 4, length = 64 * 256; // of rates, the last one a narrow band
    for (const auto& [hz, expected] : {std::pair{60.3, 0}, {53.9, 0}, {53.5, 1}, {27.1, 1}, {26.7, 2}, {11.0, 2}})
        for (std::size_t steady = 0; steady < count; ++steady) { // the rate at which it is a line
            std::vector<record_level> levels;
            for (std::size_t k = 0; k < count; ++k) {
                const double factor = std::pow(2, k); // so many times as fast for the rate
                series chance = white(length, 1e-3, 1);
                add(chance, 1, turning_at(hz * factor, chance_amplitude(length, hz * factor, 0.005, 2)));
                levels.push_back(level_of({k == steady ? sine(hz * factor, length, constant) : chance}));
                levels[k].fs_hz = sample_rate / factor;
                levels[k].top = k > 0 ? 0.42 : 0.48;
                levels[k].zoomed = k + 1 == count;
            }
            std::vector<consensus_mode> modes = {found_at(hz, 0.005)};
            mark_lines(levels, 0, 1, false, modes);
            TEST_ASSERT_EQUAL_UINT64(static_cast<int>(steady) == expected ? 1 : 0, modes[0].why.size());
        }
}

/// Within 0.003 of 50 or 60 Hz of a multiple of theirs.
static void lines_of_the_mains_are_pickup() {
    for (const auto& [hz, code] : {std::pair{50.14, "pickup"},
                                   {50.16, "tone"},
                                   {49.86, "pickup"},
                                   {49.84, "tone"},
                                   {100.14, "pickup"},
                                   {100.16, "tone"},
                                   {60.17, "pickup"},
                                   {60.19, "tone"},
                                   {119.83, "pickup"},
                                   {119.81, "tone"}})
        TEST_ASSERT_EQUAL_STRING(code, why({sine(hz, usual, constant)}, {found_at(hz, 0.005)}).c_str());
}

/// Thirds to eighths of the rate, within three ten thousandths, with 98 % of the power in one output.
static void simple_parts_of_the_rate_are_pickup() {
    series chance = white(usual, 1, 1);
    const auto at = [&](double hz, double second) {
        return why({chance, chance}, {found_at(hz, 0.02, {1.0, second})});
    };
    for (const double part :
         {1.0 / 3, 1.0 / 4, 1.0 / 5, 2.0 / 5, 1.0 / 6, 1.0 / 7, 2.0 / 7, 3.0 / 7, 1.0 / 8, 3.0 / 8}) {
        const double hz = part * sample_rate;
        for (const double way : {-1.0, 1.0}) {
            TEST_ASSERT_EQUAL_STRING("pickup", at(hz * (1 + way * 2.9e-4), 0.01).c_str());
            TEST_ASSERT_EQUAL_STRING("", at(hz * (1 + way * 3.1e-4), 0.01).c_str());
        }
    }
    TEST_ASSERT_EQUAL_STRING("", at(sample_rate / 9, 0.01).c_str());
    TEST_ASSERT_EQUAL_STRING("pickup", at(64, 0.142).c_str());                 // 0.9802
    TEST_ASSERT_EQUAL_STRING("", at(64, 0.144).c_str());                       // 0.9797
    TEST_ASSERT_EQUAL_STRING("", why({chance}, {found_at(64, 0.02)}).c_str()); // of one output no shape speaks
}

/// Twice to five times the frequency, within a hundredth and a half, a tenth of the amplitude, seven tenths in phase.
static void multiples_of_a_vibration_are_harmonics() {
    for (const int n : {2, 3, 5}) {
        TEST_ASSERT_EQUAL_STRING("harmonic", why_of_multiple(n, 1, 0.02, 10 * n).c_str());
        TEST_ASSERT_EQUAL_STRING("", why_of_multiple(n, 0, 0.02, 10 * n).c_str());
    }
    TEST_ASSERT_EQUAL_STRING("", why_of_multiple(6, 1, 0.01, 60).c_str());
    TEST_ASSERT_EQUAL_STRING("harmonic", why_of_multiple(2, 1, 0.02, 20.29).c_str());
    TEST_ASSERT_EQUAL_STRING("", why_of_multiple(2, 1, 0.02, 20.31).c_str());
    TEST_ASSERT_EQUAL_STRING("harmonic", why_of_multiple(2, 1, 0.08, 20).c_str());
    TEST_ASSERT_EQUAL_STRING("", why_of_multiple(2, 1, 0.13, 20).c_str());
    TEST_ASSERT_EQUAL_STRING("harmonic", why_of_multiple(2, 0.9, 0.02, 20).c_str());
    TEST_ASSERT_EQUAL_STRING("", why_of_multiple(2, 0.45, 0.02, 20).c_str());
    TEST_ASSERT_EQUAL_STRING("harmonic",
                             why_of_multiple(2, 1, 0.02, 20, 0.5).c_str()); // of a vibration that is believed
    TEST_ASSERT_EQUAL_STRING("", why_of_multiple(2, 1, 0.02, 20, 0.49).c_str());
}

/// The phases of a single decay are those of its hit, at multiples too.
static void a_single_decay_has_no_harmonics() {
    const std::size_t count = 20'000;
    analytic decay(count), square(count);
    for (std::size_t t = 0; t < count; ++t) {
        decay[t] = std::exp(-4e-4 * static_cast<double>(t));
        square[t] = decay[t] * decay[t];
    }
    series out = white(count, 1e-6, 1);
    add(out, 1, turning_at(10, decay));
    add(out, 0.02, turning_at(20, square));
    TEST_ASSERT_EQUAL_STRING("", why({out}, {found_at(10, 0.0016), found_at(20, 0.0016)}).c_str());
}

/// Hits that nobody measured: all modes begin in phase at each, and the second one is no multiple for that.
static void vibrations_between_hits_are_no_harmonics() {
    const auto hits = hits_in(usual, 1);
    series out = white(usual, 1e-5, 1);
    add(out, 1, turning_at(10, struck(usual, 10, 0.004, hits)));
    add(out, 0.05, turning_at(20.02, struck(usual, 20.02, 0.004, hits)));
    TEST_ASSERT_EQUAL_STRING("", why({out}, {found_at(10, 0.004), found_at(20.02, 0.004)}).c_str());
}

/// On for a third of the time at one level; at levels that scatter it is no machine.
static void a_tone_that_goes_on_and_off_is_a_line() {
    for (const double scatter : {0.07, 0.14}) {
        const series out = sine(20, usual, [scatter](std::size_t block) {
            return block / 8 % 3 > 0 ? 0.01 : block % 2 ? 1 + scatter : 1 - scatter;
        });
        TEST_ASSERT_EQUAL_STRING(scatter < 0.1 ? "tone" : "", why({out}, {found_at(20, 0.005)}).c_str());
    }
    for (const std::size_t steps : {1, 2}) { // so many of eight between on and off
        const series out = sine(20, usual, [steps](std::size_t block) {
            return block % 8 < steps ? 0.3 : block / 8 % 2 ? 0.01 : 1.0;
        });
        TEST_ASSERT_EQUAL_STRING(steps == 1 ? "tone" : "", why({out}, {found_at(20, 0.005)}).c_str());
    }
    for (const std::size_t blocks : {7, 8}) { // eight show a spread; these, of eight periods, have no parts
        const series once = sine(20, 64 * 200, [blocks](std::size_t block) { return block < blocks ? 1 : 0.01; });
        TEST_ASSERT_EQUAL_STRING(blocks == 8 ? "tone" : "", why({once}, {found_at(20, 0.005)}).c_str());
    }
    const series shorter = sine(1, 8 * 200, constant); // than a block of eight periods: no block at all
    TEST_ASSERT_EQUAL_STRING("tone", why({shorter}, {found_at(1, 0.009)}).c_str());
    for (const std::size_t blocks : {6, 7}) { // on for a tenth of the time, at least
        const series seldom = sine(20, usual, [blocks](std::size_t block) { return block < blocks ? 1 : 0.01; });
        TEST_ASSERT_EQUAL_STRING(blocks == 7 ? "tone" : "", why({seldom}, {found_at(20, 0.005)}).c_str());
    }
}

/// Shorter than a block: parts of blocks show it. A vibration that chance forces drive has all levels in those too.
static void a_tone_that_goes_on_and_off_often_is_a_line() {
    series out = sine(20, usual, constant), chance = white(usual, 1e-3, 1);
    for (std::size_t t = 0; t < usual; ++t)
        if (t / (usual / 64 * 3 / 4) % 2) out[t] *= 0.01;
    TEST_ASSERT_EQUAL_STRING("tone", why({out}, {found_at(20, 0.0005)}).c_str());
    for (const unsigned seed : {2, 3, 4, 5}) {
        add(chance, 1, turning_at(20, chance_amplitude(usual, 20, 0.0005, seed)));
        TEST_ASSERT_EQUAL_STRING("", why({chance}, {found_at(20, 0.0005)}).c_str());
    }
}

/// Of a machine whose speed wanders: as strong as the tone itself, within 0.003 and in phase with it.
static void multiples_of_a_tone_are_harmonics() {
    const std::size_t count = usual;
    analytic tone(count), third(count);
    double phase = 0;
    for (std::size_t t = 0; t < count; ++t) {
        phase += 2 * M_PI * 0.01 / sample_rate * std::sin(2 * M_PI * 0.05 * static_cast<double>(t) / sample_rate);
        tone[t] = std::polar(1.0, phase);
        third[t] = std::polar(1.5, 3 * phase);
    }
    const analytic chance = chance_amplitude(count, 30, 0.002, 2);
    const auto at = [&](double listed_hz, double damping_ratio, bool of_tone) {
        series out = white(count, 0.05, 3);
        add(out, 1, turning_at(10, tone));
        add(out, 1, turning_at(30, of_tone ? third : chance));
        return why({out}, {found_at(10, 0.001), found_at(listed_hz, damping_ratio)});
    };
    TEST_ASSERT_EQUAL_STRING("tone", at(30, 0.002, true).c_str()); // it is one by itself
    for (std::size_t t = 0; t < count; ++t)                        // no longer: the machine's load changes
        third[t] *= 1 + 0.8 * std::sin(2 * M_PI * 0.03 * static_cast<double>(t) / sample_rate);
    TEST_ASSERT_EQUAL_STRING("harmonic", at(30, 0.002, true).c_str());
    TEST_ASSERT_EQUAL_STRING("harmonic", at(30.08, 0.002, true).c_str());
    TEST_ASSERT_EQUAL_STRING("", at(30.1, 0.002, true).c_str());
    TEST_ASSERT_EQUAL_STRING("", at(30, 0.011, true).c_str());
    TEST_ASSERT_EQUAL_STRING("", at(30, 0.002, false).c_str());
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(an_amplitude_that_hardly_scatters_is_a_line);
    RUN_TEST(what_is_damped_more_than_a_hundredth_is_no_line);
    RUN_TEST(an_amplitude_that_stays_in_blocks_as_short_as_its_width_is_a_tone);
    RUN_TEST(a_mode_under_even_blows_is_no_tone);
    RUN_TEST(a_tone_that_wanders_is_no_mode);
    RUN_TEST(the_ends_of_a_tones_way_are_no_modes);
    RUN_TEST(a_mode_beside_a_tone_stays);
    RUN_TEST(eight_blocks_show_a_spread);
    RUN_TEST(a_vibration_is_looked_at_where_it_takes_the_fewest_samples);
    RUN_TEST(lines_of_the_mains_are_pickup);
    RUN_TEST(simple_parts_of_the_rate_are_pickup);
    RUN_TEST(multiples_of_a_vibration_are_harmonics);
    RUN_TEST(a_single_decay_has_no_harmonics);
    RUN_TEST(vibrations_between_hits_are_no_harmonics);
    RUN_TEST(a_tone_that_goes_on_and_off_is_a_line);
    RUN_TEST(a_tone_that_goes_on_and_off_often_is_a_line);
    RUN_TEST(multiples_of_a_tone_are_harmonics);
    return UNITY_END();
}
