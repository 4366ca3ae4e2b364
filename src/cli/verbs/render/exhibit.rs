//! What stands in front of the camera in one pose: the avatar, its mesh in other colours, and the scan.

use clap::ValueEnum;
use xavatar::body::{PartLabels, Registration, Skeleton};
use xavatar::mesh::camera::PinholeCamera;
use xavatar::mesh::{Colouring, SurfaceIndex, TriangleMesh};
use xavatar::render::{ColourMap, Scene, Tile, View, joint_colours, weight_colours, with_names, with_scale};
use xavatar::report::{part_colours, part_names};

/// A kind of picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Panel {
    /// The avatar's own colours
    Colour,
    /// The shape in plain grey
    Shaded,
    /// Normals: red right, green up, blue towards the camera
    Normals,
    /// Near is bright
    Depth,
    /// Body, face, hands, eyes and mouth of the nearest place on the body model
    Parts,
    /// Learned skinning: the colours of the joints, mixed
    Weights,
    /// The scan that the avatar is held against
    #[value(skip)]
    Scan,
    /// How far the avatar is from the scan
    #[value(skip)]
    Error,
}

impl Panel {
    fn name(self) -> &'static str {
        match self {
            Self::Colour => "avatar",
            Self::Shaded => "shape",
            Self::Normals => "normals",
            Self::Depth => "depth",
            Self::Parts => "parts",
            Self::Weights => "skinning",
            Self::Scan => "scan",
            Self::Error => "error",
        }
    }
}

/// What is to be shown, in order.
pub struct Panels {
    list: Vec<Panel>,
    /// Of the error's darkest colour, millimetres.
    largest_error: f32,
}

impl Panels {
    pub fn new(views: &[Panel], against: bool, largest_error: f32) -> Self {
        let mut list = Vec::new();
        let all = against.then_some(Panel::Scan).into_iter().chain(views.iter().copied());
        for panel in all.chain(against.then_some(Panel::Error)) {
            if !list.contains(&panel) {
                list.push(panel);
            }
        }
        Self { list, largest_error }
    }

    fn has(&self, panel: Panel) -> bool {
        self.list.contains(&panel)
    }
}

/// The meshes of one pose.
pub struct Exhibit {
    avatar: TriangleMesh,
    scan: Option<TriangleMesh>,
    /// The body's parts and their colours.
    part_names: Vec<(String, [u8; 3])>,
    /// The avatar's mesh in the colours of these panels.
    recoloured: Vec<(Panel, TriangleMesh)>,
    /// Of the vertices' distances to the scan, millimetres.
    mean_error: f32,
}

impl Exhibit {
    /// `weights` are those of the avatar's vertices; `body` is the posed body model, whose vertices' parts are `labels`, on
    /// `skeleton`.
    pub fn new(
        panels: &Panels,
        avatar: TriangleMesh,
        weights: Option<&[f32]>,
        scan: Option<TriangleMesh>,
        body: &[glam::Vec3],
        labels: &PartLabels,
        skeleton: &Skeleton,
    ) -> xavatar::Result<Self> {
        let mut recoloured = Vec::new();
        let mut mean_error = 0.0;
        let mut add = |panel, colours| {
            recoloured.push((panel, TriangleMesh { colouring: Colouring::Vertex(colours), ..avatar.clone() }));
        };
        if panels.has(Panel::Parts) {
            let (registration, colours) = (Registration::new(body, labels)?, part_colours(labels));
            let nearest = |vertex: &glam::Vec3| colours[registration.nearest_vertex(*vertex)];
            add(Panel::Parts, avatar.vertices.iter().map(nearest).collect());
        }
        if let Some(weights) = weights.filter(|_| panels.has(Panel::Weights)) {
            add(Panel::Weights, weight_colours(weights, &joint_colours(&skeleton.parents))?);
        }
        if let Some(scan) = &scan {
            let distances = SurfaceIndex::new(scan)?.closest_to_each(&avatar.vertices);
            let millimetres: Vec<f32> = distances.iter().map(|closest| closest.distance * 1000.0).collect();
            mean_error = millimetres.iter().sum::<f32>() / millimetres.len().max(1) as f32;
            let colour = |distance: &f32| ColourMap::Heat.colour(distance / panels.largest_error);
            add(Panel::Error, millimetres.iter().map(colour).collect());
        }
        Ok(Self { avatar, scan, part_names: part_names(skeleton), recoloured, mean_error })
    }

    /// All that has to be in the picture.
    pub fn vertices(&self) -> Vec<glam::Vec3> {
        let scan = self.scan.iter().flat_map(|scan| &scan.vertices);
        self.avatar.vertices.iter().chain(scan).copied().collect()
    }

    /// The height that it stands on, metres.
    pub fn lowest(&self) -> f32 {
        self.vertices().iter().map(|vertex| vertex.y).fold(f32::MAX, f32::min)
    }

    /// Makes the meshes ready for pictures, on a floor at this height.
    pub fn scenes(&self, panels: &Panels, floor: f32) -> xavatar::Result<Scenes<'_>> {
        let lit = |mesh| Scene::new(mesh)?.with_ambient_occlusion(Some(floor));
        let avatar = match panels.has(Panel::Colour) || panels.has(Panel::Shaded) {
            true => lit(&self.avatar)?,
            false => Scene::new(&self.avatar)?,
        };
        let scan = self.scan.as_ref().map(lit).transpose()?;
        let recoloured = self.recoloured.iter().map(|(panel, mesh)| Ok((*panel, Scene::new(mesh)?)));
        Ok(Scenes { exhibit: self, avatar, scan, recoloured: recoloured.collect::<xavatar::Result<_>>()? })
    }
}

/// An exhibit's meshes, lit.
pub struct Scenes<'a> {
    exhibit: &'a Exhibit,
    avatar: Scene<'a>,
    scan: Option<Scene<'a>>,
    recoloured: Vec<(Panel, Scene<'a>)>,
}

impl Scenes<'_> {
    /// One picture a panel, with its name.
    pub fn tiles(&self, panels: &Panels, camera: &PinholeCamera) -> xavatar::Result<Vec<Tile>> {
        panels.list.iter().filter_map(|panel| self.tile(*panel, panels, camera).transpose()).collect()
    }

    fn tile(&self, panel: Panel, panels: &Panels, camera: &PinholeCamera) -> xavatar::Result<Option<Tile>> {
        let (scene, view) = match panel {
            Panel::Colour => (Some(&self.avatar), View::Colour),
            Panel::Shaded => (Some(&self.avatar), View::Shaded),
            Panel::Normals => (Some(&self.avatar), View::Normals),
            Panel::Depth => (Some(&self.avatar), self.depth_range(camera)),
            Panel::Scan => (self.scan.as_ref(), View::Colour),
            Panel::Parts | Panel::Weights | Panel::Error => {
                (self.recoloured.iter().find(|(of, _)| *of == panel).map(|(_, scene)| scene), View::Data)
            }
        };
        let Some(scene) = scene else { return Ok(None) };
        let mut picture = scene.render(camera, view)?;
        let mut label = panel.name().to_owned();
        match panel {
            Panel::Parts => picture = with_names(&picture, &self.exhibit.part_names),
            Panel::Error => {
                picture = with_scale(&picture, ColourMap::Heat, panels.largest_error, "mm");
                label = format!("mean {:.1} mm", self.exhibit.mean_error);
            }
            _ => {}
        }
        Ok(Some(Tile::new(picture, label)))
    }

    /// From the nearest to the farthest vertex.
    fn depth_range(&self, camera: &PinholeCamera) -> View {
        let depths = || self.exhibit.avatar.vertices.iter().map(|vertex| camera.to_camera(*vertex).z);
        View::Depth { near: depths().fold(f32::MAX, f32::min), far: depths().fold(f32::MIN, f32::max) }
    }
}
