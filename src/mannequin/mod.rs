//! The built-in subject: a mannequin in the format of SMPL-X, dressed and in motion, made by code from a recipe.
mod directions;
mod flesh;
mod model;
mod recipe;
mod rig;
mod surface;

/// temporary
pub fn model() -> crate::Result<crate::body::BodyModel> {
    let recipe = recipe::Recipe::embedded()?;
    let flesh = flesh::Flesh::of(&recipe)?;
    let t = std::time::Instant::now();
    let mannequin = model::Mannequin::of(&recipe, &flesh)?;
    println!("mesh {:?} {} {}", t.elapsed(), mannequin.skin_vertices, mannequin.skin_faces);
    let a = mannequin.arrays(&recipe)?;
    println!("arrays {:?}", t.elapsed());
    let m = crate::body::BodyModel::from_arrays(std::path::Path::new("built-in"), &a);
    println!("model {:?}", t.elapsed());
    let j = m.as_ref().unwrap().pose(&Default::default()).unwrap().joints;
    println!("joint error {}", j.iter().zip(&mannequin.joints).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max));
    m
}
