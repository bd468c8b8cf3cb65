use super::*;
use models::{Card, Head, MapsCard, Runtime, Tap, colour_backbone, map_name, sha256, with_head};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// A model that takes red for structure and blue for water; nothing on a machine without the runtime.
fn red_is_structure(change: impl Fn(&mut Card)) -> Option<Model> {
    let runtime = Runtime::load(None).map_err(|error| println!("skipped: {error}")).ok()?;
    let head = Head { taps: vec![Tap { output: "colour".to_owned(), weights: vec![0.1, 0.0, -0.1] }], bias: 0.0 };
    let bytes = with_head(&colour_backbone(), &head).expect("a head");
    let text = format!(
        "name = 'red'\nsha256 = '{}'\noutput = 'logits'\nclasses = ['background', 'structure']\nthresholds = [-23.9]\n[input]\nname = 'image'\nwidth = 8\n\
         height = 8\nmean = [0.0, 0.0, 0.0]\nstd = [1.0, 1.0, 1.0]\n",
        sha256(&bytes)
    );
    let mut card = Card::parse(&text, Path::new("red.toml")).expect("good");
    card.maps = Some(MapsCard { outputs: vec![map_name("colour")], bias: 0.0, long_sides_px: vec![256, 128] });
    change(&mut card);
    Some(Model::new(card, PathBuf::from("red.onnx"), Cow::Owned(bytes), &runtime).expect("good"))
}

/// Red structure of full strength in a box, faint one in another, blue water around.
fn picture() -> Raster<[u8; 3]> {
    let mut rgb = Raster::filled(256, 192, [0, 90, 240]);
    for y in 66..126 {
        rgb.row_mut(y)[32..96].fill([200, 40, 40]);
        rgb.row_mut(y)[160..224].fill([120, 40, 110]);
    }
    rgb
}

fn share(mask: &Mask, columns: std::ops::Range<usize>) -> f64 {
    (66..126).map(|y| mask.row(y)[columns.clone()].iter().filter(|v| **v == 255).count()).sum::<usize>() as f64
        / (60.0 * columns.len() as f64)
}

#[test]
fn both_routes_find_the_structure_and_agree() {
    let Some(model) = red_is_structure(|_| ()) else { return };
    let find = |route| ml_mask(&picture(), &model, &MlOptions { route, levels: 5, ..MlOptions::default() }).expect("runs");
    let (shared, literal) = (find(Route::Shared), find(Route::Patches));
    assert_eq!((share(&literal.mask, 32..96), share(&literal.mask, 160..224)), (1.0, 1.0));
    assert_eq!(literal.mask.data().iter().filter(|v| **v == 255).count(), 2 * 64 * 60, "and nothing else");
    // Means over the working pixels in place of the patches: equal here, as the boxes end with cells.
    assert_eq!(shared.mask, literal.mask);
    assert!(shared.patches <= literal.patches, "coarse patches are split by their cells, or to be sure");
    assert!(literal.doubt > 0.0 && literal.doubt < 0.2, "{}", literal.doubt);
}

#[test]
fn without_a_core_a_part_goes() {
    let Some(model) = red_is_structure(|card| card.core = Some(10.0)) else { return };
    for route in [Route::Shared, Route::Patches] {
        let found = ml_mask(&picture(), &model, &MlOptions { route, levels: 5, ..MlOptions::default() }).expect("runs");
        assert_eq!((share(&found.mask, 32..96), share(&found.mask, 160..224)), (1.0, 0.0));
    }
}

#[test]
fn the_decision_of_the_card_is_where_structure_begins() {
    // Logits of the boxes are 16 and 1, that of the water is -24.
    for (decision, faint, water) in [(2.0, 0.0, 0.0), (-1.0, 1.0, 0.0), (-25.0, 1.0, 1.0)] {
        for route in [Route::Shared, Route::Patches] {
            let Some(model) = red_is_structure(|card| (card.decision, card.thresholds) = (decision, vec![-30.0])) else { return };
            let found = ml_mask(&picture(), &model, &MlOptions { route, levels: 5, ..MlOptions::default() }).expect("runs");
            assert_eq!(
                [share(&found.mask, 32..96), share(&found.mask, 160..224), share(&found.mask, 0..32)],
                [1.0, faint, water],
                "{decision} {route:?}"
            );
        }
    }
}

#[test]
fn specks_go_and_holes_are_filled() {
    let Some(model) = red_is_structure(|_| ()) else { return };
    let mut rgb = picture();
    // One cell of 8 x 6 pixels each.
    for y in 6..12 {
        rgb.row_mut(y)[8..16].fill([255, 0, 0]);
        rgb.row_mut(y + 84)[56..64].fill([0, 90, 240]);
    }
    let find = |clean_up| ml_mask(&rgb, &model, &MlOptions { levels: 5, clean_up, route: Route::Patches }).expect("runs").mask;
    let kept = find(CleanUp { min_structure_area: 0.0, min_hole_area: 0.0 });
    assert_eq!((kept[(10, 8)], kept[(60, 92)]), (255, 0));
    let cleaned = find(CleanUp { min_structure_area: 0.002, min_hole_area: 0.002 });
    assert_eq!((cleaned[(10, 8)], cleaned[(60, 92)]), (0, 255));
}

#[test]
fn water_is_classified_once_and_is_empty() {
    let Some(model) = red_is_structure(|_| ()) else { return };
    for route in [Route::Shared, Route::Patches] {
        let water = Raster::filled(256, 192, [0, 0, 255]);
        let found = ml_mask(&water, &model, &MlOptions { route, ..MlOptions::default() }).expect("runs");
        assert_eq!((found.patches, found.doubt, found.mask.data().iter().max()), (1, 0.0, Some(&0)));
    }
}

#[test]
fn odd_and_empty_sizes_are_masked_as_well() {
    let Some(model) = red_is_structure(|_| ()) else { return };
    for (w, h) in [(0, 0), (0, 7), (1, 1), (3, 700), (101, 77)] {
        for route in [Route::Shared, Route::Patches] {
            let found = ml_mask(&Raster::filled(w, h, [255, 0, 0]), &model, &MlOptions { route, ..MlOptions::default() }).expect("runs");
            assert_eq!((found.mask.width(), found.mask.height()), (w, h));
            assert!(found.mask.data().iter().all(|v| *v == 255), "{w} x {h}");
        }
    }
}

#[test]
fn masks_are_the_same_with_any_number_of_threads() {
    let Some(model) = red_is_structure(|_| ()) else { return };
    let with = |threads, route| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| ml_mask(&picture(), &model, &MlOptions { route, ..MlOptions::default() }).expect("runs"))
    };
    for route in [Route::Shared, Route::Patches] {
        assert_eq!(with(1, route), with(3, route));
    }
}
