// COLMAP models written by the tests, in both encodings.
#pragma once

#include <cstdint>
#include <cstring>
#include <map>
#include <span>
#include <sstream>
#include <string>
#include <vector>

namespace engine::io::samples {

struct ColmapCamera {
  std::uint32_t id;
  std::int32_t model;
  std::uint64_t width, height;
  std::vector<double> parameters;
};
struct ColmapImage {
  std::uint32_t id;
  std::vector<double> pose;  ///< qw qx qy qz tx ty tz
  std::uint32_t camera_id;
  std::string name;
  int points = 0;
};
struct ColmapPoint {
  std::uint64_t id;
  double x, y, z;
  std::uint8_t r, g, b;
  int track = 0;
};

inline const char* model_name(int id) {
  static const char* const names[] = {"SIMPLE_PINHOLE",
                                      "PINHOLE",
                                      "SIMPLE_RADIAL",
                                      "RADIAL",
                                      "OPENCV",
                                      "OPENCV_FISHEYE",
                                      "FULL_OPENCV",
                                      "FOV",
                                      "SIMPLE_RADIAL_FISHEYE",
                                      "RADIAL_FISHEYE",
                                      "THIN_PRISM_FISHEYE"};
  return names[id];
}

class Bytes {
 public:
  template <class T>
  Bytes& add(T value) {
    text.append(reinterpret_cast<const char*>(&value), sizeof value);
    return *this;
  }
  std::string text;
};

inline std::string binary(const std::vector<ColmapCamera>& cameras) {
  Bytes out;
  out.add(std::uint64_t(cameras.size()));
  for (const auto& camera : cameras) {
    out.add(camera.id).add(camera.model).add(camera.width).add(camera.height);
    for (const double parameter : camera.parameters) out.add(parameter);
  }
  return out.text;
}
inline std::string binary(const std::vector<ColmapImage>& images) {
  Bytes out;
  out.add(std::uint64_t(images.size()));
  for (const auto& image : images) {
    out.add(image.id);
    for (const double value : image.pose) out.add(value);
    out.add(image.camera_id);
    out.text += image.name + '\0';
    out.add(std::uint64_t(image.points));
    for (int i = 0; i < image.points; ++i) out.add(1.5 * i).add(2.5 * i).add(~std::uint64_t{0});
  }
  return out.text;
}
inline std::string binary(const std::vector<ColmapPoint>& points) {
  Bytes out;
  out.add(std::uint64_t(points.size()));
  for (const auto& point : points) {
    out.add(point.id).add(point.x).add(point.y).add(point.z).add(point.r).add(point.g).add(point.b).add(0.25);
    out.add(std::uint64_t(point.track));
    for (int i = 0; i < point.track; ++i) out.add(std::uint32_t(i)).add(std::uint32_t(i + 1));
  }
  return out.text;
}

inline std::string text(const std::vector<ColmapCamera>& cameras) {
  std::ostringstream out;
  out.precision(17);
  out << "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n";
  for (const auto& camera : cameras) {
    out << camera.id << ' ' << model_name(camera.model) << ' ' << camera.width << ' ' << camera.height;
    for (const double parameter : camera.parameters) out << ' ' << parameter;
    out << '\n';
  }
  return out.str();
}
inline std::string text(const std::vector<ColmapImage>& images) {
  std::ostringstream out;
  out.precision(17);
  out << "# Image list with two lines of data per image:\n\n";
  for (const auto& image : images) {
    out << image.id;
    for (const double value : image.pose) out << ' ' << value;
    out << ' ' << image.camera_id << ' ' << image.name << '\n';
    for (int i = 0; i < image.points; ++i) out << (i ? " " : "") << 1.5 * i << ' ' << 2.5 * i << " -1";
    out << '\n';
  }
  return out.str();
}
inline std::string text(const std::vector<ColmapPoint>& points) {
  std::ostringstream out;
  out.precision(17);
  out << "# 3D point list\n";
  for (const auto& point : points) {
    out << point.id << ' ' << point.x << ' ' << point.y << ' ' << point.z << ' ' << int(point.r) << ' ' << int(point.g)
        << ' ' << int(point.b) << " 0.25";
    for (int i = 0; i < point.track; ++i) out << ' ' << i << ' ' << i + 1;
    out << '\n';
  }
  return out.str();
}

inline std::span<const std::byte> as_bytes(const std::string& bytes) {
  return std::as_bytes(std::span(bytes.data(), bytes.size()));
}

/// One camera of each supported model.
inline std::vector<ColmapCamera> cameras() {
  return {{1, 0, 64, 48, {50, 32, 24}},
          {2, 1, 64, 48, {50, 51, 32, 24}},
          {3, 2, 64, 48, {50, 32, 24, 0.01}},
          {4, 3, 64, 48, {50, 32, 24, 0.01, -0.002}},
          {5, 4, 64, 48, {50, 51, 32, 24, 0.01, -0.002, 0.001, 0.0005}},
          {6, 5, 64, 48, {50, 51, 32, 24, 0.01, -0.002, 0.001, 0.0005}},
          {70, 8, 64, 48, {50, 32, 24, 0.01}},
          {900, 9, 64, 48, {50, 32, 24, 0.01, -0.002}}};
}
inline std::vector<ColmapImage> images() {
  return {{4, {0.5, 0.5, -0.5, 0.5, 1, 2, 3}, 2, "b 2.png", 2},
          {7, {1, 0, 0, 0, -0.25, 0, 4}, 900, "a.png", 0},
          {2, {0.6, 0, 0.8, 0, 0.1, 0.2, 0.3}, 1, "sub/c.png", 1}};
}
inline std::vector<ColmapPoint> points() {
  return {{1, 0.1, 0.2, 0.3, 255, 128, 0, 2}, {9, -1e6, 1.0 / 3, 5, 1, 2, 3, 0}, {1u << 31, 0, 0, 0, 0, 0, 255, 1}};
}

}  // namespace engine::io::samples
