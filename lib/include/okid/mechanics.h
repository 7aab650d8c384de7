// SPDX-License-Identifier: MIT
/// @file mechanics.h
/// From mass, damping and stiffness to a state-space model, continuous and discrete, and the way from discrete back to
/// continuous (paper eq. 1-14).
///
/// M x'' + R x' + K x = B_a u,  y = C_p x + C_v x' + C_a x'',  state z = [x; x'], n_z = 2 n_x.
#ifndef OKID_MECHANICS_H
#define OKID_MECHANICS_H

#include <okid/modal.h>
#include <okid/model.h>

#ifdef __cplusplus
extern "C" {
#endif

/// What a sensor measures; the value is the exponent b of eq. (110): a mode shows in it as shape times lambda^b.
typedef enum okid_sensing_t {
    OKID_SENSE_DISPLACEMENT = 0,
    OKID_SENSE_VELOCITY = 1,
    OKID_SENSE_ACCELERATION = 2
} okid_sensing_t;

/// What the input does between two samples.
typedef enum okid_hold_t {
    OKID_HOLD_ZERO = 0, ///< keeps its value: a force made by a D/A converter (eq. 12-14)
    OKID_HOLD_FIRST = 1 ///< goes straight to the next value: a force measured by a load cell (hammer, shaker)
} okid_hold_t;

/// Views of a mechanical system; column-major, SI units (or any consistent ones).
typedef struct okid_mechanics_t {
    int32_t n_x;            ///< degrees of freedom, >= 1
    int32_t n_u;            ///< forces, >= 1
    int32_t n_y;            ///< sensors, >= 1
    const okid_real_t* M;   ///< n_x x n_x, symmetric positive definite (its lower triangle is read)
    const okid_real_t* R;   ///< n_x x n_x
    const okid_real_t* K;   ///< n_x x n_x
    const okid_real_t* B_a; ///< n_x x n_u, forces on degrees of freedom (eq. 2; u is n_u x 1)
    const okid_real_t* C_p; ///< n_y x n_x displacements in the outputs, or NULL (none)
    const okid_real_t* C_v; ///< n_y x n_x velocities, or NULL
    const okid_real_t* C_a; ///< n_y x n_x accelerations, or NULL
} okid_mechanics_t;

/// Input map: column j of B_a is gain[j] at row dof[j].
/// @param dof   in, n_u, 0-based degree of freedom of each force
/// @param gain  in, n_u, force on the degree of freedom for one unit recorded (-1: reversed polarity), or NULL (all 1)
/// @param B_a   out, n_x x n_u
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM (also for a dof outside 0..n_x-1)
OKID_NODISCARD OKID_API okid_status_t okid_mechanics_inputs(int32_t n_x, int32_t n_u, const int32_t* dof,
                                                            const okid_real_t* gain, okid_real_t* B_a);

/// Output map: row o has gain[o] at column dof[o] of the matrix that sensing[o] names; kinds may be mixed (eq. 7).
/// @param dof      in, n_y, 0-based degree of freedom of each sensor; @param gain  in, n_y, or NULL (all 1)
/// @param sensing  in, n_y values of okid_sensing_t
/// @param C_p, C_v, C_a  out, n_y x n_x each
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM (also for a dof or a kind that does not exist)
OKID_NODISCARD OKID_API okid_status_t okid_mechanics_outputs(int32_t n_x, int32_t n_y, const int32_t* dof,
                                                             const okid_real_t* gain, const int32_t* sensing,
                                                             okid_real_t* C_p, okid_real_t* C_v, okid_real_t* C_a);

/// Bytes of work for okid_mechanics_continuous() and okid_mechanics_modes(). 0 if n_x or n_u is < 1.
OKID_API size_t okid_mechanics_memsize(int32_t n_x, int32_t n_u);

/// Continuous model (eq. 6, 9): A = [0 I; -M^-1 K, -M^-1 R], B = [0; M^-1 B_a], C = [C_p - C_a M^-1 K, C_v - C_a M^-1 R],
/// D = C_a M^-1 B_a. O(n_x^3) flop.
/// @param A, B, C, D  out, n_z x n_z, n_z x n_u, n_y x n_z, n_y x n_u
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY, OKID_ERR_NUMERIC (M is not positive definite)
OKID_NODISCARD OKID_API okid_status_t okid_mechanics_continuous(const okid_mechanics_t* self, okid_real_t* A,
                                                                okid_real_t* B, okid_real_t* C, okid_real_t* D,
                                                                void* work, size_t bytes);

/// Underdamped modes of M, R, K, ascending in frequency: (lambda^2 M + lambda R + K) w = 0, f = |lambda|/(2 pi),
/// zeta = -Re lambda/|lambda|. Rigid-body and overdamped motions are no modes and are left out. 25 (2 n_x)^3 flop.
/// @param self   in, n_x, M, K, and R or NULL (no damping: f are the undamped natural frequencies); the rest is not read
/// @param modes  in: arrays with room for n_x modes: frequency_hz, damping_ratio, and shape_re and shape_im (n_x x n_x, a
///               column is the displacements, largest entry 1) or NULL; the others are not written. out: count <= n_x
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY, OKID_ERR_NUMERIC (M is not positive definite)
OKID_NODISCARD OKID_API okid_status_t okid_mechanics_modes(const okid_mechanics_t* self, okid_modes_t* modes,
                                                           void* work, size_t bytes);

/// Bytes of work for okid_mechanics_c2d() and okid_mechanics_d2c(). 0 if a size is < 1.
OKID_API size_t okid_mechanics_hold_memsize(int32_t n_u, int32_t n_y, int32_t n_z);

/// Discrete model of a continuous one. C does not change.
///   zero hold  (eq. 12-14): A = e^(A_c dt), B = int_0^dt e^(A_c t) dt B_c, D = D_c
///   first hold: with G1 = phi_1(A_c dt) B_c dt, G2 = phi_2(A_c dt) B_c dt and the state z_n - G2 u_n the model takes u_n
///               alone: B = G1 - G2 + A G2, D = D_c + C G2 (phi_1(s) = (e^s - 1)/s, phi_2(s) = (e^s - 1 - s)/s^2)
/// About 25 products of (n_z + 2 n_u)-sized matrices.
/// @param continuous  in, A, B, C, D in continuous time (C may be NULL for the zero hold; K is not read)
/// @param dt          s, > 0; @param hold  okid_hold_t; @param A, B, D  out, n_z x n_z, n_z x n_u, n_y x n_u
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY, OKID_ERR_NUMERIC (an entry is not finite)
OKID_NODISCARD OKID_API okid_status_t okid_mechanics_c2d(const okid_model_t* continuous, double dt, int32_t hold,
                                                         okid_real_t* A, okid_real_t* B, okid_real_t* D, void* work,
                                                         size_t bytes);

/// Continuous model of a discrete one, pole by pole: lambda = log(mu)/dt, the principal logarithm. C does not change.
/// What was above half the sample rate when the samples were taken looks like its alias below: the model
/// returned is the one whose poles all have |Im lambda| < pi/dt. 30 n_z^3 flop.
/// @param discrete  in, A, B, C, D (C may be NULL for the zero hold; K is not read)
/// @param A, B, D   out, n_z x n_z, n_z x n_u, n_y x n_u
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY; OKID_ERR_MISMATCH: a pole is zero or real and negative,
///         no continuous model of this order samples to it (a pole of the noise: choose modes first, okid/mkr.h);
///         OKID_ERR_NUMERIC: the eigenvectors do not span the state space
OKID_NODISCARD OKID_API okid_status_t okid_mechanics_d2c(const okid_model_t* discrete, double dt, int32_t hold,
                                                         okid_real_t* A, okid_real_t* B, okid_real_t* D, void* work,
                                                         size_t bytes);

#ifdef __cplusplus
}
#endif
#endif
