//! Passes on where Embree lies (rpath.rs, shared with the other packages), but not into a wheel for other machines, which
//! has Embree inside.

mod rpath;

fn main() {
    if std::env::var_os("CARGO_FEATURE_BUNDLED").is_none() {
        rpath::main();
    }
}
