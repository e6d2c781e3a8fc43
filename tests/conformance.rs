//! What every back end promises, whatever it draws: one suite, one line for each back end.

use polyptych::conformance::{CHECKS, Subject, find};
use polyptych::prelude::*;

fn check(backend: &str, name: &str) {
    let subject = Subject::new(Registry::builtin(), backend);
    let check = find(&name.replace('_', "-")).unwrap_or_else(|| panic!("there is no check {name}"));
    check.run(&subject).unwrap_or_else(|line| panic!("{}: {line}", check.promise));
}

/// Makes the suite's tests for a back end.
macro_rules! conforms {
    ($backend:ident) => {
        mod $backend {
            const ID: &str = stringify!($backend);
            conforms!(
                @tests same_bytes second_frame after_a_switch sizes channels every_pixel accounts required
                projections empty_scene cancelling edits parameters wild_numbers picture
            );
        }
    };
    (@tests $($test:ident)*) => {
        #[test]
        fn no_check_is_forgotten() {
            super::no_check_is_forgotten(&[$(stringify!($test)),*]);
        }
        $(#[test] fn $test() { super::check(ID, stringify!($test)); })*
    };
}

conforms!(reference);
conforms!(raster);
conforms!(voxel);
conforms!(freeform);
conforms!(stylized);

/// Checks that measure time or memory belong to `polyptych validate`, which has a machine for itself.
fn no_check_is_forgotten(tested: &[&str]) {
    let tested: Vec<String> = tested.iter().map(|name| name.replace('_', "-")).collect();
    let measured = ["stops-soon", "keeps-no-memory"];
    for check in CHECKS {
        assert!(tested.iter().any(|t| t == check.name) || measured.contains(&check.name), "{}", check.name);
    }
}
