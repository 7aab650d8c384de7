// SPDX-License-Identifier: MIT
// Links libokid and libokid_host; OKID_LIB_DIR: the folder they are in, where the linker does not look by itself.
fn main() {
    println!("cargo:rerun-if-env-changed=OKID_LIB_DIR");
    if let Ok(folder) = std::env::var("OKID_LIB_DIR") {
        println!("cargo:rustc-link-search=native={folder}");
        println!("cargo:rustc-link-arg=-Wl,-rpath,{folder}");
    }
    println!("cargo:rustc-link-lib=dylib=okid");
    println!("cargo:rustc-link-lib=dylib=okid_host");
}
