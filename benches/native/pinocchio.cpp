// Pinocchio and coal from C++, against the headers and libraries of their PyPI wheels: `pinocchio FOLDER [row ...]`, one JSON
// object a line, CPU time as everywhere. No -march=native: the libraries were built for 16-byte alignment.
#include <pinocchio/multibody.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/geometry.hpp>
#include <pinocchio/collision/collision.hpp>
#include <coal/BVH/BVH_model.h>
#include <coal/shape/convex.h>
#include <coal/shape/geometric_shapes.h>
#include <Eigen/QR>
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>
namespace pin = pinocchio;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

static const double PI = 3.14159265358979323846;
static const double DH[6][4] = {{0, 0, .29, 0},           {-PI / 2, 0, 0, -PI / 2}, {0, .27, 0, 0},
                                {-PI / 2, .07, .302, 0}, {PI / 2, 0, 0, 0},        {-PI / 2, 0, .072, PI}};
static const bool MASK[6][4] = {{0, 0, 0, 0}, {1, 1, 0, 1}, {1, 1, 1, 1}, {1, 1, 1, 1}, {1, 1, 1, 1}, {1, 1, 0, 0}};
static const Vector3d TOOL(.05, .02, .1);
static std::string folder;
static std::vector<std::string> rows;

static bool wants(const std::string& row) { return rows.empty() || std::find(rows.begin(), rows.end(), row) != rows.end(); }

static double cpu() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

static volatile double sink;

// Median CPU seconds of a call over 9 batches of at least 50 ms.
template <class F>
double measure(F f) {
  size_t count = 1, k = 0;
  auto batch = [&](size_t n) {
    double start = cpu();
    for (size_t i = 0; i < n; ++i) sink = f(k++);
    return cpu() - start;
  };
  batch(1);
  while (batch(count) < 0.05) count *= 2;
  std::vector<double> all;
  for (int i = 0; i < 9; ++i) all.push_back(batch(count) / double(count));
  std::sort(all.begin(), all.end());
  return all[4];
}

static void report(const std::string& row, const char* who, double seconds, const std::string& accuracy, bool coal = false) {
  std::printf("{\"row\": \"%s\", \"who\": \"%s\", \"version\": \"%s\", \"seconds\": %.9e, \"accuracy\": \"%s\"}\n", row.c_str(), who,
              coal ? "coal " COAL_VERSION_TEXT : "pinocchio " PINOCCHIO_VERSION_TEXT, seconds, accuracy.c_str());
  std::fflush(stdout);
}

static pin::SE3 turn(const Vector3d& axis, double angle) {
  return pin::SE3(Eigen::AngleAxisd(angle, axis).toRotationMatrix(), Vector3d::Zero());
}
static pin::SE3 shift(double x, double y, double z) { return pin::SE3(Matrix3d::Identity(), Vector3d(x, y, z)); }
static pin::SE3 placement(const double* row) {
  return turn(Vector3d::UnitX(), row[0]) * shift(row[1], 0, row[2]) * turn(Vector3d::UnitZ(), row[3]);
}

static pin::FrameIndex build(pin::Model& m) {
  pin::JointIndex j = 0;
  for (int i = 0; i < 6; ++i) {
    j = m.addJoint(j, pin::JointModelRZ(), placement(DH[i]), "j" + std::to_string(i));
    m.appendBodyToJoint(j, pin::Inertia::FromSphere(3.0, 0.1), pin::SE3::Identity());
  }
  return m.addFrame(pin::Frame("tool", j, 0, pin::SE3(Matrix3d::Identity(), TOOL), pin::OP_FRAME));
}

static std::vector<std::vector<double>> read(const std::string& name, bool header) {
  std::ifstream in(folder + "/" + name);
  std::string line;
  std::vector<std::vector<double>> out;
  if (header) std::getline(in, line);
  while (std::getline(in, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream words(line);
    std::vector<double> row;
    for (double x; words >> x;) row.push_back(x);
    out.push_back(row);
  }
  return out;
}

struct Data {
  std::vector<VectorXd> q;
  std::vector<Vector3d> p;
};

static Data points(const std::string& name) {
  Data data;
  for (auto& r : read(name, true)) {
    data.q.push_back(VectorXd::Map(r.data(), 6) * PI / 180);
    data.p.push_back(Vector3d(r[6], r[7], r[8]) * 1e-3);
  }
  return data;
}

// Ball minus reading turned by the nominal arm, as the other peers get them.
static Data touches(const std::string& name) {
  static const double BALLS[3][3] = {{0.36, -0.15, 0.16}, {0.36, 0.15, 0.16}, {0.55, 0.0, 0.20}};
  pin::Model m;
  build(m);
  pin::Data d(m);
  Data data;
  for (auto& r : read(name, true)) {
    VectorXd q = VectorXd::Map(r.data() + 1, 6) * PI / 180;
    pin::forwardKinematics(m, d, q);
    data.q.push_back(q);
    data.p.push_back(Vector3d(BALLS[int(r[0]) - 1]) - d.oMi[6].rotation() * Vector3d(r[7], r[8], r[9]) * 1e-3);
  }
  return data;
}

// Gauss-Newton on Pinocchio's regressor of joint placements: 17 link parameters, base pose, tool point.
struct Fit {
  pin::Model m;
  pin::FrameIndex tool;
  double dh[6][4];
  pin::SE3 base = pin::SE3::Identity();

  Fit() {
    tool = build(m);
    std::copy(&DH[0][0], &DH[0][0] + 24, &dh[0][0]);
  }
  void place() {
    for (int i = 0; i < 6; ++i) m.jointPlacements[i + 1] = i == 0 ? base * placement(dh[0]) : placement(dh[i]);
  }
  double run(const Data& data) {
    const long n = long(data.q.size());
    MatrixXd J(3 * n, 26), R = MatrixXd::Zero(6, 36);
    VectorXd r(3 * n);
    for (int iteration = 0; iteration < 20; ++iteration) {
      place();
      pin::Data d(m);
      Eigen::Matrix<double, 6, 4> A[6];
      for (int i = 0; i < 6; ++i) {
        pin::SE3 B = turn(Vector3d::UnitZ(), dh[i][3]), X = shift(dh[i][1], 0, dh[i][2]) * B;
        A[i].col(0) = X.toActionMatrixInverse().col(3);
        A[i].col(1) = B.toActionMatrixInverse().col(0);
        A[i].col(2) = B.toActionMatrixInverse().col(2);
        A[i].col(3) = Eigen::Matrix<double, 6, 1>::Unit(5);
      }
      for (long k = 0; k < n; ++k) {
        pin::forwardKinematics(m, d, data.q[k]);
        pin::updateFramePlacements(m, d);
        pin::computeFrameKinematicRegressor(m, d, tool, pin::LOCAL_WORLD_ALIGNED, R);
        int c = 0;
        for (int i = 1; i < 6; ++i) {
          Eigen::Matrix<double, 3, 4> block = R.block<3, 6>(0, 6 * i) * A[i];
          for (int j = 0; j < 4; ++j)
            if (MASK[i][j]) J.block<3, 1>(3 * k, c++) = block.col(j);
        }
        J.block<3, 6>(3 * k, 17) = R.block<3, 6>(0, 0);
        J.block<3, 3>(3 * k, 23) = d.oMf[tool].rotation();
        r.segment<3>(3 * k) = d.oMf[tool].translation() - data.p[k];
      }
      VectorXd step = n > 200 ? VectorXd((J.transpose() * J).ldlt().solve(-J.transpose() * r))
                              : VectorXd(J.householderQr().solve(-r));
      int c = 0;
      for (int i = 1; i < 6; ++i)
        for (int j = 0; j < 4; ++j)
          if (MASK[i][j]) dh[i][j] += step[c++];
      pin::SE3 P = placement(dh[0]);
      base = base * P * pin::exp6(pin::Motion(step.segment<6>(17))) * P.inverse();
      m.frames[tool].placement.translation() += step.tail<3>();
      if (step.cwiseAbs().maxCoeff() < 1e-9) break;
    }
    place();
    return base.translation()[0];
  }
  std::string held_out(const std::string& name) {
    pin::Data d(m);
    Data data = points(name);
    double sum = 0;
    for (size_t k = 0; k < data.q.size(); ++k) {
      pin::framesForwardKinematics(m, d, data.q[k]);
      sum += (d.oMf[tool].translation() - data.p[k]).squaredNorm();
    }
    char text[40];
    std::snprintf(text, sizeof text, "%.2f um", 1e6 * std::sqrt(sum / double(data.q.size())));
    return text;
  }
};

static void identification() {
  for (bool many : {false, true}) {
    std::string row = std::string("identification, ") + (many ? "1000 poses" : "45 touches") + ", 26 parameters";
    if (!wants(row)) continue;
    Data data = many ? points("rigid_points.csv") : touches("rigid_touches.csv");
    double t = measure([&](size_t) { return Fit().run(data); });
    Fit fit;
    fit.run(data);
    report(row, "Pinocchio, C++ by hand: regressor, Gauss-Newton", t, fit.held_out("rigid_heldout.csv"));
  }
}

static std::shared_ptr<coal::CollisionGeometry> shape(const std::string& kind, std::istringstream& in) {
  std::vector<double> x;
  for (double v; in >> v;) x.push_back(v);
  if (kind == "capsule") return std::make_shared<coal::Capsule>(x[0], x[1]);
  if (kind == "box") return std::make_shared<coal::Box>(x[0], x[1], x[2]);
  std::vector<coal::Vec3s> points;
  for (size_t i = 1; i + 2 < x.size(); i += 3) points.emplace_back(x[i], x[i + 1], x[i + 2]);
  coal::ConvexBase* hull = coal::ConvexBase::convexHull(points.data(), unsigned(points.size()), true, "Qt");
  return std::shared_ptr<coal::CollisionGeometry>(hull);
}

static void collision(const std::string& kind, const std::vector<VectorXd>& q) {
  std::string row = "collision check, " + kind + "s";
  if (!wants(row)) return;
  pin::Model m;
  build(m);
  pin::Data d(m);
  pin::GeometryModel g;
  std::ifstream in(folder + "/scene_" + kind + ".txt");
  std::vector<pin::GeomIndex> links, still;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    size_t frame;
    double x, y, z;
    std::string what;
    words >> frame >> x >> y >> z >> what;
    auto id = g.addGeometryObject(pin::GeometryObject("g" + std::to_string(g.ngeoms), frame, shift(x, y, z), shape(what, words)));
    (frame ? links : still).push_back(id);
  }
  for (size_t i = 0; i < links.size(); ++i) {
    for (auto b : still) g.addCollisionPair(pin::CollisionPair(links[i], b));
    for (size_t j = i + 3; j < links.size(); ++j) g.addCollisionPair(pin::CollisionPair(links[i], links[j]));
  }
  pin::GeometryData gd(g);
  size_t hits = 0;
  for (auto& x : q) hits += pin::computeCollisions(m, d, g, gd, x, true);
  double t = measure([&](size_t k) { return double(pin::computeCollisions(m, d, g, gd, q[k % q.size()], true)); });
  report(row, "coal, C++, by Pinocchio, stops at the first",
         t, std::to_string(g.collisionPairs.size()) + " pairs, " + std::to_string(hits) + " of " + std::to_string(q.size()) + " collide", true);
}

int main(int argc, char** argv) {
  folder = argv[1];
  rows.assign(argv + 2, argv + argc);
  std::vector<VectorXd> q;
  for (auto& r : read("joints.txt", false)) q.push_back(VectorXd::Map(r.data(), 6));
  pin::Model m;
  pin::FrameIndex f = build(m);
  pin::Data d(m);
  const size_t n = q.size();
  if (wants("forward kinematics"))
    report("forward kinematics", "Pinocchio, C++", measure([&](size_t k) {
             pin::forwardKinematics(m, d, q[k % n]);
             pin::updateFramePlacement(m, d, f);
             return d.oMf[f].translation()[0];
           }), "");
  if (wants("Jacobian")) {
    Eigen::Matrix<double, 6, Eigen::Dynamic> J = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, 6);
    report("Jacobian", "Pinocchio, C++", measure([&](size_t k) {
             J.setZero();
             pin::computeFrameJacobian(m, d, q[k % n], f, pin::LOCAL_WORLD_ALIGNED, J);
             return J(0, 0);
           }), "");
  }
  if (wants("parameter Jacobian")) {
    MatrixXd R = MatrixXd::Zero(6, 36);
    report("parameter Jacobian", "Pinocchio, C++, frame regressor", measure([&](size_t k) {
             pin::forwardKinematics(m, d, q[k % n]);
             pin::updateFramePlacements(m, d);
             pin::computeFrameKinematicRegressor(m, d, f, pin::LOCAL_WORLD_ALIGNED, R);
             return R(0, 0);
           }), "6 x 36");
  }
  identification();
  for (const char* kind : {"capsule", "box", "hull"}) collision(kind, q);
}
