// SPDX-License-Identifier: MIT
// A mode whose pole is chosen here, simulated here, comes back from both libraries; so does a message for what is wrong.
use okid_sys::*;
use std::ffi::{CStr, CString};

const RATE_HZ: f64 = 100.0;
const FREQUENCY_HZ: f64 = 12.5;
const DAMPING: f64 = 0.02;
const SAMPLES: usize = 4000;

/// Rows [u; y]: white force, the sampled response of one mode, and noise of 0.1 % by a generator of its own.
fn record() -> Vec<f64> {
    let omega = 2.0 * std::f64::consts::PI * FREQUENCY_HZ / RATE_HZ;
    let radius = (-DAMPING * omega).exp();
    let angle = omega * (1.0 - DAMPING * DAMPING).sqrt();
    let (mut seed, mut y1, mut y2, mut u1) = (1u64, 0.0, 0.0, 0.0);
    let mut white = || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let mut rows = Vec::new();
    for _ in 0..SAMPLES {
        let (u, noise) = (white(), white());
        let y = 2.0 * radius * angle.cos() * y1 - radius * radius * y2 + u1;
        rows.extend([u, y + 1e-3 * noise]);
        (y2, y1, u1) = (y1, y, u);
    }
    rows
}

#[test]
fn kernels_find_the_mode() {
    let rows = record();
    unsafe {
        let mut how: okid_identify_config_t = std::mem::zeroed();
        (how.n_u, how.n_y, how.p, how.order, how.fs_hz, how.detrend) = (1, 1, 10, 2, RATE_HZ, OKID_DETREND_MEAN);
        let mut shape: okid_accumulator_config_t = std::mem::zeroed();
        (shape.n_u, shape.n_y, shape.lags, shape.forgetting) = (1, 1, okid_identify_lags(&how), 1.0);
        let (bytes, more) = (okid_accumulator_memsize(&shape), okid_identify_memsize(&how));
        assert!(bytes > 0 && more > 0);
        let (mut block, mut room) = (vec![0u64; bytes / 8 + 1], vec![0u64; more / 8 + 1]);
        let (mut sums, mut identifier) = (std::ptr::null_mut(), std::ptr::null_mut());
        assert_eq!(okid_accumulator_create(&mut sums, &shape, block.as_mut_ptr().cast(), bytes), OKID_OK);
        assert_eq!(okid_identify_create(&mut identifier, &how, room.as_mut_ptr().cast(), more), OKID_OK);
        assert_eq!(okid_accumulator_add(sums, rows.as_ptr(), SAMPLES), OKID_OK);
        let mut found: okid_identified_t = std::mem::zeroed();
        assert!(okid_identify_run(identifier, sums, &mut found) >= OKID_OK);
        assert_eq!(found.mode_count, 1);
        assert!((*found.frequency_hz / FREQUENCY_HZ - 1.0).abs() < 1e-5);
        assert!((*found.damping_ratio / DAMPING - 1.0).abs() < 1e-3);
    }
}

#[test]
fn host_library_finds_it_and_says_what_is_wrong() {
    let rows = record();
    let identify = |options: &str| unsafe {
        let options = CString::new(options).unwrap();
        let (samples, name) = (rows.as_ptr(), b"record\0".as_ptr().cast());
        let (null, mut result) = (std::ptr::null_mut(), std::ptr::null_mut());
        let code = okid_host_identify(options.as_ptr(), 1, &samples, &SAMPLES, &name, None, null, &mut result);
        (code, result)
    };
    unsafe {
        assert_eq!(okid_host_abi(), OKID_HOST_ABI);
        let (code, result) = identify(r#"{"inputs": ["force"], "outputs": ["acc"], "fs": 100.0, "method": "okid-era", "order": 2}"#);
        assert_eq!(code, 0, "{}", CStr::from_ptr(okid_host_error()).to_string_lossy());
        let mut array: okid_host_array_t = std::mem::zeroed();
        assert_eq!(okid_host_result_array(result, b"modes.frequency_hz\0".as_ptr().cast(), &mut array), 1);
        assert!((*(array.data as *const f64) / FREQUENCY_HZ - 1.0).abs() < 1e-5);
        okid_host_result_delete(result);
        let (code, result) = identify(r#"{"inputs": ["force"], "outputs": ["acc"], "fs": -1}"#);
        assert_eq!((code, result.is_null()), (2, true));
        assert!(CStr::from_ptr(okid_host_error()).to_str().unwrap().contains("fs"));
    }
}
