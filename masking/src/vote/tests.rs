use super::*;
use scene::Raster;

/// Textured ground, seen shifted, turned and scaled; water in its upper part.
fn ground(motion: &Affine, floor: bool) -> Raster<[u8; 3]> {
    let (w, h) = (480usize, 300usize);
    let mut rgb = Raster::filled(w, h, [0u8; 3]);
    for y in 0..h {
        let (start, step) = motion.along_row(y, w, h);
        for x in 0..w {
            let (u, v) = (start[0] + step[0] * x as f64, start[1] + step[1] * x as f64);
            let noise = f64::from((x * 7919 + y * 104_729) as u32 % 7) - 3.0;
            let detail =
                40.0 * (u / 9.0).sin() * (v / 13.0).cos() + 25.0 * ((u + 2.0 * v) / 31.0).sin() + 20.0 * ((u * v).sqrt() / 17.0).sin();
            let value = if floor && v > 90.0 { 110.0 + detail } else { 150.0 };
            rgb[(x, y)] = [(value + noise).clamp(0.0, 255.0) as u8; 3];
        }
    }
    rgb
}

fn box_mask(left: usize, right: usize) -> Mask {
    let mut mask = Raster::filled(480, 300, 0);
    (100..220).for_each(|y| mask.row_mut(y)[left..right].fill(255));
    mask
}

fn share(mask: &Mask, of: &Mask) -> f64 {
    let both = mask.data().iter().zip(of.data()).filter(|(a, b)| **a == 255 && **b == 255).count();
    let either = mask.data().iter().zip(of.data()).filter(|(a, b)| **a == 255 || **b == 255).count();
    both as f64 / either.max(1) as f64
}

fn shifted(pixels: f64) -> Affine {
    Affine { terms: [1.0, 0.0, pixels / 480.0, 0.0, 1.0, 0.0] }
}

#[test]
fn the_motion_of_a_plane_is_found() {
    for terms in [[1.0, 0.0, 0.08, 0.0, 1.0, -0.03], [1.04, 0.03, -0.05, -0.03, 1.04, 0.04], [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]] {
        let map = Affine { terms };
        // The second image shows the first one through the inverse: a place (x, y) of the first is map(x, y) of the second.
        let (first, second) = (ground(&map, true), ground(&Affine::IDENTITY, true));
        let found = motion(&Glimpse::new(&first), &Glimpse::new(&second)).expect("they resemble each other");
        for (x, y) in [(-0.3, 0.0), (0.3, 0.2), (0.0, 0.25)] {
            let (a, b) = (found.at(x, y), map.at(x, y));
            // Half a pixel of the glimpse.
            assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 0.5 / 160.0, "{terms:?}: {found:?}");
        }
    }
}

#[test]
fn water_and_other_places_tell_no_motion() {
    let [floor, water] = [true, false].map(|floor| Glimpse::new(&ground(&Affine::IDENTITY, floor)));
    assert_eq!(motion(&water, &water), None);
    assert_eq!(motion(&floor, &water), None);
    let elsewhere = Glimpse::new(&ground(&Affine { terms: [0.3, 0.8, 2.0, -0.8, 0.3, 3.0] }, true));
    assert_eq!(motion(&floor, &elsewhere), None);
    assert_eq!(motion(&floor, &Glimpse::new(&Raster::filled(300, 480, [9; 3]))), None, "another size");
    assert_eq!(motion(&Glimpse::new(&Raster::filled(0, 0, [9; 3])), &Glimpse::new(&Raster::filled(0, 0, [9; 3]))), None);
}

#[test]
fn one_wrong_mask_is_overruled() {
    // Structure moves by 12 pixels from image to image.
    let (before, now, after) = (box_mask(112, 312), box_mask(100, 300), box_mask(88, 288));
    let earlier = [Neighbour { mask: &before, motion: shifted(12.0) }];
    let later = [Neighbour { mask: &after, motion: shifted(-12.0) }];
    assert_eq!(vote(&now, &earlier, &later), now, "nothing changes where they agree");
    let (empty, full) = (Raster::filled(480, 300, 0), Raster::filled(480, 300, 255));
    assert_eq!(vote(&empty, &earlier, &later), now);
    let cleared = vote(&full, &earlier, &later);
    // But for the strips at either side that a neighbour does not show.
    assert!((0..300).all(|y| cleared.row(y)[12..468] == now.row(y)[12..468]));
    assert_eq!(vote(&empty, &earlier, &[]), empty, "without both sides nothing changes");
    // Two of three on either side.
    let (earlier, later) =
        ([earlier[0], Neighbour { mask: &empty, ..earlier[0] }, earlier[0]], [later[0], later[0], Neighbour { mask: &empty, ..later[0] }]);
    assert_eq!(vote(&empty, &earlier, &later), now);
    let odd = Raster::filled(3, 3, 255);
    assert_eq!(vote(&now, &[Neighbour { mask: &odd, motion: Affine::IDENTITY }], &later), now);
}

#[test]
fn motions_that_are_a_little_wrong_do_no_harm() {
    let now = box_mask(100, 300);
    // 8 pixels too far, the border to one side in both: less than 2 % of the long side.
    let neighbour = [Neighbour { mask: &now, motion: shifted(8.0) }];
    assert_eq!(vote(&now, &neighbour, &neighbour), now);
    // 30 pixels too far, and opposite, as parallax does.
    let [earlier, later] = [30.0, -30.0].map(|pixels| [Neighbour { mask: &now, motion: shifted(pixels) }]);
    let voted = vote(&now, &earlier, &later);
    assert!(share(&voted, &now) > 0.999, "{}", share(&voted, &now));
}
