//! Volumes as textures.

use eframe::egui_wgpu::RenderState;
use eframe::wgpu;

pub fn extent([width, height, depth_or_array_layers]: [u32; 3]) -> wgpu::Extent3d {
    wgpu::Extent3d {
        width,
        height,
        depth_or_array_layers,
    }
}

pub fn volume(state: &RenderState, format: wgpu::TextureFormat, dims: [u32; 3]) -> wgpu::Texture {
    state.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("stylet slice"),
        size: extent(dims),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D3,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    })
}

/// Writes a volume; returns the number of bytes sent.
pub fn write(state: &RenderState, texture: &wgpu::Texture, bytes: &[u8], bytes_per_texel: u32) -> u64 {
    let size = texture.size();
    let layout = wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(size.width * bytes_per_texel),
        rows_per_image: Some(size.height),
    };
    state.queue.write_texture(texture.as_image_copy(), bytes, layout, size);
    bytes.len() as u64
}
