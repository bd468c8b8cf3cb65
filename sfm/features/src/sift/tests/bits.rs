//! The same bits on every instruction set and any number of threads.

use super::picture::textured;
use crate::SiftOptions;
use crate::sift::extract::extract_with;
use crate::sift::simd::Simd;

/// Widths that are no multiple of any number of lanes, heights that make several bands.
const SIZES: [(usize, usize); 3] = [(333, 301), (67, 1100), (40, 29)];

fn options() -> Vec<SiftOptions> {
    let d = SiftOptions::default;
    vec![d(), SiftOptions { double_image: true, max_features: 500, ..d() }]
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    for (width, height) in SIZES {
        let image = textured(width, height, 11);
        for options in options() {
            let expected = extract_with(Simd::Portable, &image, None, &options).expect("valid options");
            for simd in Simd::available() {
                let found = extract_with(simd, &image, None, &options).expect("valid options");
                assert_eq!(found, expected, "{simd:?}");
            }
        }
    }
}

#[test]
fn one_and_two_threads_give_the_same_bits() {
    let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads start");
    let (one, two) = (pool(1), pool(2));
    for (width, height) in SIZES {
        let image = textured(width, height, 12);
        for options in options() {
            let run = || extract_with(Simd::best(), &image, None, &options).expect("valid options");
            assert_eq!(one.install(run), two.install(run));
        }
    }
}
