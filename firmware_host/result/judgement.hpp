// SPDX-License-Identifier: MIT
// PURPOSE  every number that decides whether a mode is believed, with its unit and its reason
// METHOD   docs/how-okid-decides.md is the rule in words; tests/mutation/run changes the numbers and asks the unit tests to notice
#pragma once
#include <cstddef>

namespace okid_host::judgement {

// A track: the poles of one run that are the same vibration from one order to the next.
constexpr double most_damping = 0.25;   ///< a pole above is no vibration to an engineer
constexpr double same_frequency = 0.01; ///< relative, within a run and between runs
constexpr double same_widths =
    2; ///< times the damping ratio, if that is less: two of a doublet are hundredths of a percent apart
constexpr double least_same_frequency = 1e-5; ///< relative: what a run knows at best
constexpr double same_damping = 0.3;          ///< relative, from one order to the next
constexpr double same_shape_of_a_run = 0.9;   ///< MAC, from one order to the next
constexpr int fewest_orders = 4;              ///< a shorter track is chance
constexpr double share_of_orders = 0.4;       ///< of the orders from its first on
constexpr int order_reach = 8;                ///< states for which a pole may be missing

// What a run can see.
constexpr double periods_seen = 0.75; ///< of a mode within the horizon; with fewer its pole is a trend
constexpr double periods_least = 0.3; ///< where several outputs together have periods_seen
constexpr double periods_sharp = 1.5; ///< where its damping is sharp
constexpr double beats_seen =
    0.75; ///< of a mode and its neighbour within the horizon; with fewer a run sees one of both
constexpr double least_alike = 0.1; ///< MAC with that neighbour: shapes part two modes where time alone does not
constexpr double decays_left = 2; ///< in a horizon: what has fallen to a seventh at its end still tells something there
constexpr double most_filled = 0.75;     ///< of a run's states, by two for each mode: above, weak ones find no room
constexpr double surely_shared = 0.95;   ///< canonical correlation at that many states: there are more
constexpr std::size_t fewest_voters = 6; ///< runs with the longest horizons, which vote in any case

// Agreement: found_in x EMAC x (1 + MPC)/2 / (1 + (scatter of damping / scatter_scale)^2).
constexpr double same_shape = 0.8; ///< MAC, between runs
constexpr double much_nearer =
    0.5; ///< of the distance of a track: if its run has another one so near, that is the mode
constexpr double as_lightly_damped = 3; ///< … factor in damping of that other one
constexpr int fewest_runs = 3;          ///< of MOESP and CVA, which share their projections, two may err alike
constexpr double least_found_in = 0.5;  ///< of the runs that vote
constexpr double least_agreement = 0.5; ///< below: short-lived, complex or scattering
constexpr double agreed_by_chance =
    0.7; ///< without a force; below, more modes are false than true if their damping is unsure too
constexpr double scatter_scale = 0.6;   ///< relative scatter of damping over the runs that halves the agreement
constexpr double overdamped = 0.2;      ///< damping ratio: above, a mode is listed and not believed
constexpr double clear_vibration = 0.8; ///< agreement of a mode that all runs find
constexpr double doubtful_emac = 0.5;   ///< of a named method: below, a mode seldom belongs to the structure
constexpr double worth_listing = 0.25;  ///< of agreement or of the runs: below, a cluster is chance
constexpr double doubtful_share = 0.5;  ///< of the runs: fewer, and a doubtful mode is not listed by itself
constexpr double widest_damping =
    0.5; ///< sigma of damping over damping: of one output without a force, and of responses
constexpr double wide_damping =
    1; ///< … from where on a mode has a warning, and of one output under a force is not believed
constexpr double widest_frequency = 0.05; ///< sigma of a frequency over it
constexpr double fewest_periods = 8;      ///< of a mode in the record: fewer are a trend

// Two that may be one.
constexpr double most_widths = 2.5; ///< half-power widths within which two of one shape may be one
constexpr double nearly_all =
    0.9; ///< of the runs that vote: where so many see both, two are two (pairs of tests/kinds)
constexpr double same_residues = 0.9; ///< MAC of the residues of two poles that are one mode, of responses

// Of measured responses, a mode that the fit knows though runs scatter.
constexpr std::size_t fewest_outputs_known = 3; ///< with fewer, two points in phase are chance
constexpr double real_shape = 0.95;             ///< MPC
constexpr double known_strength = 5;            ///< of its residues over their noise
constexpr double known_share = 0.1;             ///< of the half-width: deviations of f and of damping

// A line: a vibration that a machine keeps up, and no resonance.
constexpr double steady = 0.25;     ///< spread over mean of an amplitude; 0.52 for noise in a narrow band (Rice 1945)
constexpr double of_chance = 0.52;  ///< … of a vibration under chance forces
constexpr double surely_steady = 2; ///< times 1 / sqrt(blocks) less is no chance: five deviations
constexpr double steady_wandering =
    0.3;                             ///< … of a tone that wanders, at most: 0.2 seen, 0.35 of a mode under even blows
constexpr double wanders_as_far = 2; ///< times the scatter of its frequency: it comes by there
constexpr double off_its_frequency = 0.5; ///< cycles of a block: where the power is so far off, another line leaks in
constexpr double steady_on = 0.1;         ///< … of a machine that goes on and off, while it is on
constexpr double on = 0.5, off = 0.15;    ///< of its amplitude
constexpr double on_or_off = 0.85;        ///< of the blocks; of a random vibration a half
constexpr std::size_t fewest_blocks = 8;  ///< below that a spread means nothing
constexpr std::size_t line_blocks = 64;   ///< into which a record is cut
constexpr double line_periods = 8;        ///< in a block, at least
constexpr double fall_periods = 3;        ///< … where a fall is looked for
constexpr double line_damping = 0.01;     ///< a pole damped more is no line
constexpr double unresolved_decays = 2;   ///< in the record: with fewer a decay and a line look the same
constexpr double falls = 3;               ///< deviations of a slope: from here on an amplitude falls
constexpr double as_damped = 2; ///< factor between the fall of an amplitude and that of the mode's own damping
constexpr double begun = 0.05;  ///< of the largest force: the first hit
constexpr double loudest_silence =
    0.07; ///< of its usual amplitude: a line stronger would be seen in the silence before the force
constexpr double quieter = 0.5;           ///< amplitude before the hits over that of the record
constexpr double mains_tolerance = 0.003; ///< relative, of a multiple of 50 or 60 Hz
constexpr int rate_parts = 8;             ///< fs / 8, 2 fs / 8 ..: where a converter and its clock leave lines
constexpr double on_the_rate = 3e-4;      ///< relative, of such a part
constexpr double in_one_output = 0.98;    ///< of the power of a shape

// A multiple of a stronger vibration, and what the force alone shows.
constexpr int most_multiple = 5;             ///< of a vibration, looked at
constexpr double multiple_frequency = 0.015; ///< relative distance from a multiple, a sum or a difference
constexpr double in_phase =
    0.7; ///< coherence of phases; 1: always. Linear structures stay below 0.45; chance 1/sqrt(blocks)
constexpr double explained =
    0.5;                    ///< of a mode's amplitude by the forces: they excite it, no machine and no product does
constexpr double leaks = 2; ///< cycles in a block: a vibration that is no farther off shows in it
constexpr double one_to_a_block = 0.5;     ///< cycles in a block: two vibrations that are nearer look like one
constexpr std::size_t blocks_a_number = 2; ///< at least, where it is found what forces explain
constexpr double goes_on =
    0.1; ///< of the amplitude, beside what a record begins with and what leaks in; a tone leaves less
constexpr double of_hits = 1;      ///< spread over mean of a force that mostly rests; 0.52 of a random one
constexpr double ring_periods = 3; ///< in a block, to see a vibration ring down between hits
constexpr double falling = 0.1; ///< steps down less steps up of an amplitude, of all; hits 0.2 and more, no hits 0.05
constexpr double stronger = 10; ///< amplitude of the vibration over that of its multiple
constexpr double product_periods = 6;  ///< in a block, of the slowest factor
constexpr double machine_periods = 32; ///< in a block at most, to see a tone and its multiples
constexpr double answered_before =
    1.5;                           ///< power left of an output, over that with the next sample of the force: it is late
constexpr double force_line = 10;  ///< power of a line of the force over that beside it
constexpr double force_ends = 100; ///< power of a force over that beyond the edge of its band
constexpr double resonance_peak = 2; ///< power of the responses, over that of the force, at a mode over beside it

// Distortion: products of stronger vibrations.
constexpr std::size_t product_blocks = 16;    ///< to speak of a coherence
constexpr int most_factors = 3;               ///< of a product
constexpr double nonlinear_in_phase = 0.5;    ///< where the structure is known not to be linear
constexpr double nonlinear_frequency = 0.025; ///< relative; its frequencies move with the level
constexpr double surely_in_phase = 0.75;      ///< where no mode was found; the largest of linear structures is 0.5
constexpr double by_chance = 12; ///< blocks times coherence squared: phases of chance exceed it once in e^12 (Rayleigh)
constexpr double left_alone = 0.8; ///< of the power at a mode: the force has no part in it
constexpr double undriven = 0.5;   ///< … where the structure is known not to be linear

// Outputs that the model explains far less than the others.
constexpr double noisy_left = 0.15; ///< of an output's amplitude, in a simulation
constexpr double noisier = 5;       ///< times the share of the middle one; 2.2 among good sensors of measured records
constexpr std::size_t fewest_to_compare = 3; ///< outputs
constexpr double in_a_noisy_output = 0.8;    ///< of the power of a shape; of modes of the structure 0.65 and less

// A part of a record for the whole: the free decays after events (trains over a bridge), a force without the noise of its rest.
constexpr double fall_of_power = 100; ///< from the greatest of an event; cars on a road have it too, `sharper` decides
constexpr double still_driven = 10;   ///< of the greatest power a tenth and more is of what acts
constexpr double sharper =
    0.5; ///< deviations, over those of the whole: below 0.3 after trains, 0.8 to 1.1 of cars on a road
constexpr double explains_better =
    0.8; ///< power left of the outputs, over that with what the channel of a resting force says
constexpr double shared_modes = 0.5; ///< of those of the whole that the part shows, too

// Records without a force that are no repeats.
constexpr double one_shape = 0.8;       ///< of the power at a mode: two close modes mix otherwise in each record
constexpr double moved_shape = 0.5;     ///< MAC of two records: below, sensors were at other places
constexpr std::size_t fewest_moved = 2; ///< modes; of one a change of the wind may be the reason
constexpr double surely_apart = 4;      ///< deviations between the frequencies of two modes

// An output that changes: a step of what the others say of it, over its scatter. In 87 simulated ambient records without a change 4.6
// at most; a gain of 1.3 makes 5 to 10, of 2 at least 18, a turned sensor 35 and more.
constexpr double changed_step = 8;
constexpr double no_step = 2; ///< is left without the output that changed

// Outputs that are late, by the phases of shapes: two groups 20 ms apart leave 6 to 74 times what chance leaves, and with
// delays less than once; of 150 simulated records without late outputs two have more than 4, and delays explain neither.
constexpr std::size_t fewest_modes_late = 3; ///< with fewer, delays explain any shapes
constexpr double complex_shapes = 4;         ///< of the squared deviations from real shapes: 1 is chance
constexpr double explained_by_delays = 5;    ///< so many times less is left
constexpr double delays_by_chance = 1e-4;    ///< at most: that so little is left of phases that are no delays

// Frequency responses.
constexpr double least_strength = 2; ///< of a residue matrix over its noise
constexpr double narrowest = 0.25;   ///< half a resonance's width in lines: below it no damping shows
constexpr double edge_lines = 2;     ///< from the ends of the band

} // namespace okid_host::judgement
