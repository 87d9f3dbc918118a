// Values anywhere on a ray, gradients, and Phong's factors. shaders/src/twin/light.rs is the same on the CPU.

// factor, glint: what a colour is multiplied by, and how much white is added per opacity.
const UNLIT: vec2<f32> = vec2(1.0, 0.0);

// The code of V' anywhere.
fn value_at(reader: Reader, p: vec3<f32>) -> f32 {
    let deep = deep_at(p);
    if deep.y != 0.0 {
        return deep.x;
    }
    return read_volume(reader, p) * brick.code_scale;
}

// A place that the last gradient would use holds no data.
var<private> lacks_gradient: bool;

fn rise_along(reader: Reader, p: vec3<f32>, axis: vec3<f32>) -> f32 {
    let ahead = read_volume(reader, min(p + axis, volume_hi)) * brick.code_scale;
    let behind = read_volume(reader, max(p - axis, vec3(0.0))) * brick.code_scale;
    lacks_gradient = lacks_gradient || is_no_data(min(ahead, behind));
    return ahead - behind;
}

fn light_at(reader: Reader, ray: Ray, p: vec3<f32>) -> vec2<f32> {
    if deep_at(p).y != 0.0 {
        return UNLIT;
    }
    lacks_gradient = false;
    let rise = vec3(
        rise_along(reader, p, vec3(1.0, 0.0, 0.0)),
        rise_along(reader, p, vec3(0.0, 1.0, 0.0)),
        rise_along(reader, p, vec3(0.0, 0.0, 1.0)),
    );
    if HOLES && lacks_gradient {
        return UNLIT;
    }
    let gradient = rise * 0.5 * frame.voxels_per_unit;
    let steepness = sqrt(dot(gradient, gradient));
    // Homogeneous material is not lit by its noise.
    let part = clamp(steepness / scene_data.style.light_from - 1.0, 0.0, 1.0);
    let strength = part * part * (3.0 - 2.0 * part);
    if strength == 0.0 {
        return UNLIT;
    }
    return lit(ray, gradient, steepness, strength);
}

// Phong's factors on the face, of the volume or of a clip, by which the ray enters: the cut is flat, whatever is cut.
fn light_of_entry(ray: Ray) -> vec2<f32> {
    var normal = -ray.direction / frame.voxels_per_unit;
    var t_in = 0.0;
    for (var i = 0u; i < scene_data.style.plane_count; i++) {
        let plane = scene_data.style.planes[i];
        let inside = dot(plane.xyz, ray.origin) - plane.w;
        let along = dot(plane.xyz, ray.direction);
        if along > 0.0 && -inside / along > t_in {
            t_in = -inside / along;
            normal = plane.xyz * frame.voxels_per_unit;
        }
    }
    let flat = ray.direction == vec3(0.0);
    let enter = select(min(-ray.origin * ray.inverse, (volume_hi - ray.origin) * ray.inverse), vec3(-FAR), flat);
    for (var axis = 0; axis < 3; axis++) {
        if enter[axis] > t_in {
            t_in = enter[axis];
            normal = vec3(0.0);
            normal[axis] = 1.0;
        }
    }
    return lit(ray, normal, sqrt(dot(normal, normal)), 1.0);
}

fn lit(ray: Ray, gradient: vec3<f32>, steepness: f32, strength: f32) -> vec2<f32> {
    let to_eye = -ray.direction / frame.voxels_per_unit;
    let to_light = select(scene_data.style.light, to_eye, all(scene_data.style.light == vec3(0.0)));
    let along = dot(gradient, to_light) / steepness;
    // Both sides are lit: the normal is on the light's.
    let side = select(1.0, -1.0, along < 0.0);
    let half = to_light + to_eye;
    let length = max(sqrt(dot(half, half)), 1e-6);
    let shine = clamp(side * dot(gradient, half) / (steepness * length), 0.0, 1.0);
    let factor = scene_data.style.ambient + scene_data.style.diffuse * min(side * along, 1.0);
    // A power of zero is not defined.
    let shininess = scene_data.style.shininess;
    let power = select(0.0, pow(max(shine, 1e-30), shininess), shine > 0.0 || shininess == 0.0);
    return vec2(1.0 + (factor - 1.0) * strength, scene_data.style.specular * power * strength);
}

// Straight colour under a light; no brighter than white.
fn lit_color(color: vec3<f32>, light: vec2<f32>) -> vec3<f32> {
    return min(color * light.x + light.y, vec3(1.0));
}
