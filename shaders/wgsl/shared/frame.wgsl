@group(0) @binding(0) var<storage, read> frame_data: FrameUniform;

fn load_frame() -> FrameUniform {
    return frame_data;
}
