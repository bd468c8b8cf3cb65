//! The surface of a cloud, cut and measured: what the stage and the command share.

use anyhow::Result;
use scene::{Cloud, Mesh};
use serde_json::{Value, json};
use surface::{
    Footprint, PoissonOptions, SurfaceError, closed_volume, holes, profile_rugosity, reconstruct, rim_plane, rugosity, standing_volume,
    surface_area, trim,
};

/// Share of the median density below which the surface is cut off, where none is given.
pub const TRIM: f64 = 0.25;
/// Pieces below this share of the area are left out.
const MIN_ISLAND: f64 = 0.001;
/// Edge of the cells of the footprint, cells of the octree.
const FOOTPRINT_CELLS: f64 = 2.0;
/// Profiles along each of two directions.
const PROFILES: usize = 20;

/// Makes the surface of a cloud, cuts it where the points are sparser than `trim_share` of their median density, and measures it.
///
/// # Errors
/// [`SurfaceError`] where there is no surface to make.
pub fn make(cloud: &Cloud, options: &PoissonOptions, trim_share: f64) -> Result<(Mesh, Value), SurfaceError> {
    let made = reconstruct(cloud, options)?;
    let threshold = trim_share * made.median_density;
    let (mesh, _, cut) = trim(&made.mesh, &made.density, threshold, MIN_ISLAND)?;
    let found = holes(&mesh)?;
    let plane = match rim_plane(&mesh) {
        Ok(plane) => Some(plane),
        Err(SurfaceError::NoPlane) => None,
        Err(e) => return Err(e),
    };
    // A closed surface has no rim; of an open one the longest loop is no hole.
    let inner = found.loops.get(1..).unwrap_or_default();
    let standing = |plane| {
        let footprint = Footprint::new(&mesh, plane, FOOTPRINT_CELLS * made.summary.cell)?;
        standing_volume(&made.mesh, &made.density, threshold, plane, &footprint)
    };
    let over_plane = plane.as_ref().map(standing).transpose()?;
    let figures = json!({
        "points": made.summary.points,
        "depth": made.summary.depth,
        "cell": made.summary.cell,
        "vertices": mesh.vertices.len(),
        "faces": mesh.faces.len(),
        "trimmed_share": cut.share,
        "islands": cut.islands,
        "area": surface_area(&mesh)?,
        "closed_volume": closed_volume(&mesh).ok(),
        "holes": {
            "count": inner.len(),
            "length": inner.iter().map(|h| h.length).sum::<f64>(),
            "area": inner.iter().map(|h| h.area).sum::<f64>(),
        },
        "rim_length": found.loops.first().map_or(0.0, |rim| rim.length),
        "plane": plane.as_ref().map(|p| json!({"point": p.point.coords.as_slice(), "normal": p.normal.as_slice()})),
        "over_plane": over_plane,
        "rugosity": plane.as_ref().and_then(|p| rugosity(&mesh, p).ok()).map(|r| r.ratio),
        "profiles": plane.as_ref().and_then(|p| profile_rugosity(&mesh, p, PROFILES).ok()),
    });
    Ok((mesh, figures))
}
