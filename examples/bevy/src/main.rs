//! A plane, a pole, a white sphere and a rough metal one under a sky of veni: `cargo run` after the command in README.md. Space writes
//! `bevy.png`. The scene is that of scripts/engines in Bevy's axes: native (x, y, z) is (−y, z, −x).

// what `veni-cli ibl --engine bevy` wrote, as it is
#[path = "../assets/sky/sky.rs"]
mod sky;

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::CascadeShadowConfigBuilder;
use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, save_to_disk};

fn main() {
    App::new()
        .add_plugins(DefaultPlugins)
        .add_systems(Startup, setup)
        .add_systems(Update, (sharpen_shadows, screenshot))
        .run();
}

fn setup(
    mut commands: Commands,
    assets: Res<AssetServer>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let camera = commands
        .spawn((
            Camera3d::default(),
            // its default exposure, EV 9.7, is about one per 1000 cd/m², which is the unit of the folder
            Tonemapping::TonyMcMapface,
            Projection::Perspective(PerspectiveProjection { fov: 34f32.to_radians(), ..default() }),
            Transform::from_xyz(-0.6, 2.1, 6.2).looking_at(Vec3::new(0.0, 0.75, 0.0), Vec3::Y),
        ))
        .id();
    sky::sky(&mut commands, &assets, camera);

    let mut matt = |grey: f32| {
        materials.add(StandardMaterial {
            base_color: Color::linear_rgb(grey, grey, grey),
            perceptual_roughness: 1.0,
            reflectance: 0.0,
            ..default()
        })
    };
    let (ground, stone) = (matt(0.5), matt(0.8));
    let metal = materials.add(StandardMaterial {
        base_color: Color::linear_rgb(0.9, 0.9, 0.9),
        metallic: 1.0,
        perceptual_roughness: 0.3,
        ..default()
    });
    let ball = meshes.add(Sphere::new(0.6).mesh().uv(128, 64));
    commands.spawn((Mesh3d(meshes.add(Plane3d::default().mesh().size(60.0, 60.0))), MeshMaterial3d(ground)));
    commands.spawn((
        Mesh3d(meshes.add(Cylinder::new(0.1, 2.0))),
        MeshMaterial3d(stone.clone()),
        Transform::from_xyz(0.0, 1.0, 0.0),
    ));
    commands.spawn((Mesh3d(ball.clone()), MeshMaterial3d(stone), Transform::from_xyz(1.5, 0.6, -0.2)));
    commands.spawn((Mesh3d(ball), MeshMaterial3d(metal), Transform::from_xyz(-1.4, 0.6, -0.6)));
}

/// The default cascades are for a landscape.
fn sharpen_shadows(mut commands: Commands, suns: Query<Entity, Added<DirectionalLight>>) {
    for sun in &suns {
        let near = CascadeShadowConfigBuilder { maximum_distance: 20.0, ..default() }.build();
        commands.entity(sun).insert(near);
    }
}

fn screenshot(mut commands: Commands, keys: Res<ButtonInput<KeyCode>>) {
    if keys.just_pressed(KeyCode::Space) {
        commands.spawn(Screenshot::primary_window()).observe(save_to_disk("bevy.png"));
    }
}
