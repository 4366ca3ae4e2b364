//! Registrations: meshes of a body's topology, told from whatever else is in a folder by how many vertices they have.
//!
//! `<folder>/<subject>/.../<frame>.ply` (or .obj, .glb), the folder of one subject (`train/` and `test/`, a `gender.txt`), or FAUST's
//! `tr_reg_000.ply`, ten frames a subject, in one folder. Of a subject that has bodies moved onto scans, in `offsets/`, these alone. Of each
//! folder of meshes the first says whether the others are looked at: scans stand beside registrations. Nothing is kept in memory: a frame is read when it is needed. V vertices; metres.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec3;
use rayon::prelude::*;
use xavatar_formats::{Error, Result};
use xavatar_mesh::{MESH_EXTENSIONS, read_mesh};
use xavatar_register::job::OFFSETS_FOLDER;

/// Folders of what is known of a made-up population.
pub(crate) const TRUTH: &str = "truth";
/// What lies in the folder of one subject.
const OF_ONE: [&str; 5] = ["gender.txt", "subject.toml", "mean_shape_smplx.npy", "train", "test"];
/// Frames of each of FAUST's subjects.
const FAUST_FRAMES: usize = 10;

/// What a body is trained on or measured by.
#[derive(Clone, Debug)]
pub struct Registrations {
    /// In the order of their names.
    pub subjects: Vec<Subject>,
    /// V.
    pub vertices: usize,
}

/// A person's registrations.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Subject {
    /// The folder's name.
    pub name: String,
    /// Meshes, in the order of their paths.
    pub frames: Vec<PathBuf>,
}

impl Registrations {
    /// The registrations of a body of so many vertices, in these folders; a mesh's own path stands for itself.
    ///
    /// # Errors
    /// [`Error::Missing`] if there are none; those of reading folders and meshes.
    pub fn find(paths: &[PathBuf], vertices: usize) -> Result<Self> {
        let mut subjects = Vec::new();
        for path in paths {
            let found = if path.is_dir() { subjects_of(path, vertices)? } else { vec![single(path)] };
            if found.is_empty() {
                return Err(Error::Missing {
                    path: path.clone(),
                    what: format!("a mesh of {vertices} vertices, as the body has"),
                    remedy: "give the folder of registrations, and the body whose topology they have".into(),
                });
            }
            subjects.extend(found);
        }
        Ok(Self { subjects, vertices })
    }

    /// How many frames there are.
    pub fn frames(&self) -> usize {
        self.subjects.iter().map(|subject| subject.frames.len()).sum()
    }

    /// The vertices (V) of a registration.
    ///
    /// # Errors
    /// Those of reading a mesh; [`Error::Mismatch`] for another number of vertices.
    pub fn read(&self, path: &Path) -> Result<Vec<DVec3>> {
        let mesh = read_mesh(path)?.mesh;
        if mesh.vertices.len() != self.vertices {
            return Err(Error::Mismatch {
                path: path.into(),
                found: format!("{} vertices", mesh.vertices.len()),
                expected: format!("{}, as the body has", self.vertices),
                remedy: "take the mesh out, or give the body whose topology it has".into(),
            });
        }
        Ok(mesh.vertices.iter().map(|vertex| vertex.as_dvec3()).collect())
    }

    /// All of a person's registrations (N, V).
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn read_all(&self, subject: &Subject) -> Result<Vec<Vec<DVec3>>> {
        subject.frames.par_iter().map(|path| self.read(path)).collect()
    }
}

fn single(path: &Path) -> Subject {
    Subject { name: name_of(path), frames: vec![path.into()] }
}

fn subjects_of(folder: &Path, vertices: usize) -> Result<Vec<Subject>> {
    let subject = |folder: &Path| -> Result<Option<Subject>> {
        let mut frames = Vec::new();
        let moved = folder.join(OFFSETS_FOLDER);
        collect(if moved.is_dir() { &moved } else { folder }, vertices, &mut frames)?;
        Ok((!frames.is_empty()).then(|| Subject { name: name_of(folder), frames }))
    };
    if OF_ONE.iter().any(|name| folder.join(name).exists()) {
        return Ok(subject(folder)?.into_iter().collect());
    }
    let (folders, meshes) = entries(folder)?;
    if let Some(first) = meshes.first()
        && vertex_count(first)? == vertices
    {
        return Ok(by_faust_number(&meshes).unwrap_or_else(|| vec![Subject { name: name_of(folder), frames: meshes }]));
    }
    let people = folders.iter().filter(|folder| folder.file_name().is_none_or(|name| name != TRUTH));
    people.filter_map(|folder| subject(folder).transpose()).collect()
}

/// All registrations below a folder.
fn collect(folder: &Path, vertices: usize, frames: &mut Vec<PathBuf>) -> Result<()> {
    let (folders, meshes) = entries(folder)?;
    if let Some(first) = meshes.first()
        && vertex_count(first)? == vertices
    {
        frames.extend(meshes);
    }
    folders.iter().try_for_each(|folder| collect(folder, vertices, frames))
}

/// FAUST's subjects, if all meshes are named as its are.
fn by_faust_number(meshes: &[PathBuf]) -> Option<Vec<Subject>> {
    let mut subjects: BTreeMap<usize, Vec<PathBuf>> = BTreeMap::new();
    for path in meshes {
        let number: usize = path.file_stem()?.to_str()?.strip_prefix("tr_reg_")?.parse().ok()?;
        subjects.entry(number / FAUST_FRAMES).or_default().push(path.clone());
    }
    Some(subjects.into_iter().map(|(number, frames)| Subject { name: format!("{number:02}"), frames }).collect())
}

/// The folders and the meshes in a folder, by name.
fn entries(folder: &Path) -> Result<(Vec<PathBuf>, Vec<PathBuf>)> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        paths.push(entry.map_err(Error::io(folder))?.path());
    }
    paths.sort();
    let is_mesh = |path: &PathBuf| {
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        MESH_EXTENSIONS.contains(&extension.to_ascii_lowercase().as_str())
    };
    let (folders, files): (Vec<PathBuf>, Vec<PathBuf>) = paths.into_iter().partition(|path| path.is_dir());
    Ok((folders, files.into_iter().filter(is_mesh).collect()))
}

fn vertex_count(path: &Path) -> Result<usize> {
    Ok(read_mesh(path)?.mesh.vertices.len())
}

fn name_of(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use xavatar_mesh::{TriangleMesh, write_ply};

    use super::*;

    fn mesh(path: &Path, vertices: usize) {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        let vertices = (0..vertices).map(|vertex| glam::Vec3::splat(vertex as f32)).collect();
        write_ply(path, &TriangleMesh { vertices, faces: vec![[0, 1, 2]], ..TriangleMesh::default() }).unwrap();
    }

    #[test]
    fn subjects_are_folders_and_scans_are_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["b/walk/2.ply", "b/walk/1.ply", "a/1.ply", "truth/body.ply"] {
            mesh(&at(name), 4);
        }
        mesh(&at("a/scans/1.ply"), 9);
        let found = Registrations::find(&[folder.path().into()], 4).unwrap();
        let names: Vec<&str> = found.subjects.iter().map(|subject| subject.name.as_str()).collect();
        assert_eq!(names, ["a", "b"]);
        assert_eq!(found.subjects[1].frames, [at("b/walk/1.ply"), at("b/walk/2.ply")]);
        assert_eq!(found.frames(), 3);
        assert_eq!(found.read(&at("a/1.ply")).unwrap()[3], DVec3::splat(3.0));
        let message = found.read(&at("a/scans/1.ply")).unwrap_err().to_string();
        assert!(message.contains("9 vertices, expected 4"), "{message}");
        let message = Registrations::find(&[folder.path().into()], 5).unwrap_err().to_string();
        assert!(message.contains("a mesh of 5 vertices"), "{message}");
    }

    #[test]
    fn bodies_that_were_moved_onto_scans_stand_for_those_that_were_not() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["anna/train/Take1/SMPLX/1.ply", "anna/offsets/train/Take1/1.ply", "bob/train/Take1/SMPLX/1.ply"] {
            mesh(&folder.path().join(name), 4);
        }
        let frames = |path: PathBuf| -> Vec<PathBuf> {
            let subjects = Registrations::find(&[path], 4).unwrap().subjects;
            subjects.into_iter().flat_map(|subject| subject.frames).collect()
        };
        let at = |name: &str| folder.path().join(name);
        let moved = at("anna/offsets/train/Take1/1.ply");
        assert_eq!(frames(at("anna")), std::slice::from_ref(&moved));
        assert_eq!(frames(folder.path().into()), [moved, at("bob/train/Take1/SMPLX/1.ply")]);
    }

    #[test]
    fn one_subject_and_fausts_ten_are_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        for name in [
            "anna/train/Take1/SMPLX/1.ply",
            "anna/test/Take2/SMPLX/1.ply",
            "faust/tr_reg_009.ply",
            "faust/tr_reg_010.ply",
        ] {
            mesh(&folder.path().join(name), 4);
        }
        let subjects = |name: &str| Registrations::find(&[folder.path().join(name)], 4).unwrap().subjects;
        assert_eq!(subjects("anna").len(), 1);
        assert_eq!(subjects("anna")[0].frames.len(), 2);
        let faust = subjects("faust");
        assert_eq!(faust.iter().map(|subject| subject.frames.len()).collect::<Vec<_>>(), [1, 1]);
    }
}
