//! The rig as a scene's text: `/avatar` with skeleton, clip, mesh, morphs and material.

use std::fmt::Write;

use glam::{Affine3A, Vec3};

use super::text::{identifier, list, matrix, number, quaternion, quoted, tuple, vector};
use crate::export::rig::{Animation, Joint, Morph, RiggedMesh};
use crate::mesh::Colouring;

/// The scene; `picture` is the name of the texture's file.
pub(super) fn text(rigged: &RiggedMesh, picture: &str) -> String {
    let rate = number(rigged.animation.frames_per_second);
    let last = rigged.animation.frames().saturating_sub(1);
    let (low, high) = bounds(rigged);
    let mut scene = format!(
        r#"#usda 1.0
(
    defaultPrim = "avatar"
    doc = "xavatar {version}"
    endTimeCode = {last}
    framesPerSecond = {rate}
    metersPerUnit = 1
    startTimeCode = 0
    timeCodesPerSecond = {rate}
    upAxis = "Y"
)

def SkelRoot "avatar" (
    prepend apiSchemas = ["SkelBindingAPI"]
    kind = "component"
)
{{
    float3[] extent = [{low}, {high}]
"#,
        version = env!("CARGO_PKG_VERSION"),
        low = vector(low),
        high = vector(high),
    );
    let joints = joint_paths(&rigged.joints);
    let joints = list(&joints, |path| quoted(path));
    skeleton(&mut scene, rigged, &joints);
    clip(&mut scene, rigged, &joints);
    mesh(&mut scene, rigged);
    material(&mut scene, &rigged.mesh.colouring, picture);
    scene + "}\n"
}

/// The box around the bind pose and all of the clip's frames.
fn bounds(rigged: &RiggedMesh) -> (Vec3, Vec3) {
    let frames = (0..rigged.animation.frames()).map(|frame| rigged.posed(frame));
    let boxes = std::iter::once(rigged.mesh.vertices.clone()).chain(frames).map(|vertices| {
        let corner = |fold: fn(Vec3, Vec3) -> Vec3| vertices.iter().copied().reduce(fold).unwrap_or_default();
        (corner(Vec3::min), corner(Vec3::max))
    });
    boxes.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or_default()
}

/// A joint is named by its way from the root.
fn joint_paths(joints: &[Joint]) -> Vec<String> {
    let mut paths: Vec<String> = Vec::with_capacity(joints.len());
    for joint in joints {
        let name = identifier(&joint.name);
        paths.push(joint.parent.map_or_else(|| name.clone(), |parent| format!("{}/{name}", paths[parent])));
    }
    paths
}

fn skeleton(scene: &mut String, rigged: &RiggedMesh, joints: &str) {
    let bind = list(&rigged.joints, |joint| matrix(joint.inverse_bind.inverse()));
    let rest = list(&rigged.joints, |joint| {
        let scale = Vec3::splat(joint.scale);
        matrix(Affine3A::from_scale_rotation_translation(scale, joint.rotation, joint.translation))
    });
    let _ = write!(
        scene,
        r#"
    def Skeleton "skeleton" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {{
        uniform matrix4d[] bindTransforms = {bind}
        uniform token[] joints = {joints}
        uniform matrix4d[] restTransforms = {rest}
        rel skel:animationSource = </avatar/clip>
    }}
"#
    );
}

fn clip(scene: &mut String, rigged: &RiggedMesh, joints: &str) {
    let Animation { rotations, root_translations, morph_weights, .. } = &rigged.animation;
    let samples = |of_frame: &dyn Fn(usize) -> String| {
        let rows = (0..rotations.len()).map(|frame| format!("            {frame}: {},\n", of_frame(frame)));
        format!("{{\n{}        }}", rows.collect::<String>())
    };
    let turned = samples(&|frame| list(&rotations[frame], |rotation| quaternion(*rotation)));
    let moved = samples(&|frame| {
        let places = rigged.joints.iter().map(|joint| match joint.parent {
            None => root_translations[frame],
            Some(_) => joint.translation,
        });
        list(places, vector)
    });
    let _ = write!(
        scene,
        r#"
    def SkelAnimation "clip"
    {{
        uniform token[] joints = {joints}
        quatf[] rotations.timeSamples = {turned}
        half3[] scales = {scales}
        float3[] translations.timeSamples = {moved}
"#,
        scales = list(&rigged.joints, |joint| vector(Vec3::splat(joint.scale))),
    );
    if !rigged.morphs.is_empty() {
        let names = list(&rigged.morphs, |morph| quoted(&identifier(&morph.name)));
        let count = rigged.morphs.len();
        let weights = samples(&|frame| list(&morph_weights[frame * count..][..count], |weight| number(*weight)));
        let _ = writeln!(scene, "        uniform token[] blendShapes = {names}");
        let _ = writeln!(scene, "        float[] blendShapeWeights.timeSamples = {weights}");
    }
    *scene += "    }\n";
}

fn mesh(scene: &mut String, rigged: &RiggedMesh) {
    let mesh = &rigged.mesh;
    let normals = mesh.normals.clone().unwrap_or_else(|| mesh.vertex_normals());
    let corner = |fold: fn(Vec3, Vec3) -> Vec3| vector(mesh.vertices.iter().copied().reduce(fold).unwrap_or_default());
    let _ = write!(
        scene,
        r#"
    def Mesh "mesh" (
        prepend apiSchemas = ["MaterialBindingAPI", "SkelBindingAPI"]
    )
    {{
        float3[] extent = [{low}, {high}]
        int[] faceVertexCounts = {counts}
        int[] faceVertexIndices = {indices}
        rel material:binding = </avatar/material>
        normal3f[] normals = {normals} (
            interpolation = "vertex"
        )
        point3f[] points = {points}
        matrix4d primvars:skel:geomBindTransform = {identity}
        int[] primvars:skel:jointIndices = {joints} (
            elementSize = {influences}
            interpolation = "vertex"
        )
        float[] primvars:skel:jointWeights = {weights} (
            elementSize = {influences}
            interpolation = "vertex"
        )
        rel skel:skeleton = </avatar/skeleton>
        uniform token subdivisionScheme = "none"
"#,
        low = corner(Vec3::min),
        high = corner(Vec3::max),
        counts = list(&mesh.faces, |_| "3".into()),
        indices = list(mesh.faces.as_flattened(), u32::to_string),
        normals = list(normals, vector),
        points = list(&mesh.vertices, |vertex| vector(*vertex)),
        identity = matrix(Affine3A::IDENTITY),
        joints = list(&rigged.skin_joints, u8::to_string),
        weights = list(&rigged.skin_weights, |weight| number(*weight)),
        influences = rigged.influences,
    );
    match &mesh.colouring {
        Colouring::None => {}
        Colouring::Vertex(colours) => {
            let linear = |channel: u8| {
                let encoded = f32::from(channel) / 255.0;
                if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
            };
            let colours = list(colours, |colour| tuple(&colour.map(linear)));
            interpolated(scene, "color3f[] primvars:displayColor", &colours);
        }
        Colouring::Texture { uvs, .. } => {
            interpolated(scene, "texCoord2f[] primvars:st", &list(uvs, |uv| tuple(&[uv.x, 1.0 - uv.y])));
        }
    }
    if !rigged.morphs.is_empty() {
        let names = list(&rigged.morphs, |morph| quoted(&identifier(&morph.name)));
        let targets = list(&rigged.morphs, |morph| format!("</avatar/mesh/{}>", identifier(&morph.name)));
        let _ = writeln!(scene, "        uniform token[] skel:blendShapes = {names}");
        let _ = writeln!(scene, "        rel skel:blendShapeTargets = {targets}");
        rigged.morphs.iter().for_each(|morph| blend_shape(scene, morph));
    }
    *scene += "    }\n";
}

fn interpolated(scene: &mut String, declaration: &str, values: &str) {
    let _ = writeln!(scene, "        {declaration} = {values} (\n            interpolation = \"vertex\"\n        )");
}

/// A morph of the vertices that it moves.
fn blend_shape(scene: &mut String, morph: &Morph) {
    let moved = || morph.offsets.iter().enumerate().filter(|(_, offset)| **offset != Vec3::ZERO);
    let _ = write!(
        scene,
        r#"
        def BlendShape "{name}"
        {{
            uniform vector3f[] offsets = {offsets}
            uniform int[] pointIndices = {indices}
        }}
"#,
        name = identifier(&morph.name),
        offsets = list(moved(), |(_, offset)| vector(*offset)),
        indices = list(moved(), |(index, _)| index.to_string()),
    );
}

/// Skin and cloth: no metal, no gloss.
fn material(scene: &mut String, colouring: &Colouring, picture: &str) {
    let (reader, name, result) = match colouring {
        Colouring::Texture { .. } => (texture(picture), "texture", "rgb"),
        Colouring::Vertex(_) | Colouring::None => (vertex_colours(), "colours", "result"),
    };
    let _ = write!(
        scene,
        r#"
    def Material "material"
    {{
        token outputs:surface.connect = </avatar/material/surface.outputs:surface>

        def Shader "surface"
        {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </avatar/material/{name}.outputs:{result}>
            float inputs:metallic = 0
            float inputs:roughness = 1
            token outputs:surface
        }}
{reader}    }}
"#
    );
}

fn texture(picture: &str) -> String {
    format!(
        r#"
        def Shader "texture"
        {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{picture}@
            token inputs:sourceColorSpace = "sRGB"
            float2 inputs:st.connect = </avatar/material/coordinates.outputs:result>
            token inputs:wrapS = "clamp"
            token inputs:wrapT = "clamp"
            float3 outputs:rgb
        }}

        def Shader "coordinates"
        {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }}
"#
    )
}

fn vertex_colours() -> String {
    r#"
        def Shader "colours"
        {
            uniform token info:id = "UsdPrimvarReader_float3"
            string inputs:varname = "displayColor"
            float3 outputs:result
        }
"#
    .into()
}
