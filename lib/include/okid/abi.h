// SPDX-License-Identifier: MIT
/// @file abi.h
/// Headers and library must be of one kind: included by okid/types.h, nothing to call.
///
/// The functions that make an object, or take arrays without one, have the number of the interface and the number type in
/// their linked names: okid_identify_create_2_double. A program that was compiled for another interface or another
/// OKID_REAL does not link, instead of reading numbers as what they are not.
#ifndef OKID_ABI_H
#define OKID_ABI_H

/// Number of the interface: another one where a struct or an argument has changed.
#define OKID_ABI 2
/// @cond
#define OKID_LINKED_(name, abi, real) name##_##abi##_##real
#define OKID_LINKED_AS_(name, abi, real) OKID_LINKED_(name, abi, real)
#define OKID_LINKED(name) OKID_LINKED_AS_(name, OKID_ABI, OKID_REAL)
#define okid_accumulator_create OKID_LINKED(okid_accumulator_create)
#define okid_change_create OKID_LINKED(okid_change_create)
#define okid_correlation_create OKID_LINKED(okid_correlation_create)
#define okid_era_create OKID_LINKED(okid_era_create)
#define okid_identify_create OKID_LINKED(okid_identify_create)
#define okid_jackknife_create OKID_LINKED(okid_jackknife_create)
#define okid_refine_create OKID_LINKED(okid_refine_create)
#define okid_replicates_create OKID_LINKED(okid_replicates_create)
#define okid_skew_create OKID_LINKED(okid_skew_create)
#define okid_square_root_create OKID_LINKED(okid_square_root_create)
#define okid_stabilization_create OKID_LINKED(okid_stabilization_create)
#define okid_subspace_create OKID_LINKED(okid_subspace_create)
#define okid_track_create OKID_LINKED(okid_track_create)
#define okid_watch_create OKID_LINKED(okid_watch_create)
#define okid_markov_recursion OKID_LINKED(okid_markov_recursion)
#define okid_mechanics_c2d OKID_LINKED(okid_mechanics_c2d)
#define okid_mechanics_continuous OKID_LINKED(okid_mechanics_continuous)
#define okid_mechanics_d2c OKID_LINKED(okid_mechanics_d2c)
#define okid_mechanics_inputs OKID_LINKED(okid_mechanics_inputs)
#define okid_mechanics_modes OKID_LINKED(okid_mechanics_modes)
#define okid_mechanics_outputs OKID_LINKED(okid_mechanics_outputs)
#define okid_mkr_identify OKID_LINKED(okid_mkr_identify)
#define okid_modal_analyse OKID_LINKED(okid_modal_analyse)
#define okid_modal_mac OKID_LINKED(okid_modal_mac)
#define okid_model_fit OKID_LINKED(okid_model_fit)
#define okid_model_fit_memsize OKID_LINKED(okid_model_fit_memsize)
#define okid_model_initial_state OKID_LINKED(okid_model_initial_state)
#define okid_model_predict OKID_LINKED(okid_model_predict)
#define okid_model_simulate OKID_LINKED(okid_model_simulate)
#define okid_observer_solve OKID_LINKED(okid_observer_solve)
#define okid_observer_solve_factor OKID_LINKED(okid_observer_solve_factor)
#define okid_pdc_damping OKID_LINKED(okid_pdc_damping)
#define okid_pdc_fit OKID_LINKED(okid_pdc_fit)
#define okid_structured_leave_out OKID_LINKED(okid_structured_leave_out)
#define okid_structured_solve OKID_LINKED(okid_structured_solve)
#define okid_subspace_output_error OKID_LINKED(okid_subspace_output_error)
/// @endcond

#endif
