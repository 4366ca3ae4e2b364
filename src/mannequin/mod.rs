//! The built-in subject: a mannequin in the format of SMPL-X, dressed and in motion, made by code from a recipe.
mod flesh;
mod recipe;
mod surface;

/// temporary
pub fn skin() -> crate::Result<crate::mesh::TriangleMesh> {
    let recipe = recipe::Recipe::embedded()?;
    let _ = recipe.joint_positions()?;
    let flesh = flesh::Flesh::of(&recipe)?;
    let mesh = flesh.mesh(&recipe.mesh)?;
    let _ = flesh.joint_at(mesh.vertices[0]);
    let _ = surface::vertex_normals(&mesh.vertices, &mesh.faces);
    Ok(mesh)
}
