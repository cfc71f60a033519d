/* Estimates velocities and biases from a recording of an IMU and from measured poses, which write_recording.py writes:
 *     strapgen preintegrate --window pair-1-5 --name imu --target cpp --out out/ceres
 *     g++ -std=c++17 -O2 -Iout/ceres -I/usr/include/eigen3 -o out/ceres/estimate \
 *         examples/estimation/estimate.cpp -lceres -lglog
 *     python examples/estimation/write_recording.py | out/ceres/estimate
 */
#include "imu_cost.hpp"
#include <array>
#include <ceres/gradient_checker.h>
#include <iostream>

// A measured pose, with 1e-3 rad and 1 cm.
struct PoseCost {
    std::array<double, 7> measured;

    template <class T> bool operator()(const T *pose, T *residual) const
    {
        const Eigen::Quaterniond q(measured.data());
        const Eigen::Quaternion<T> apart = q.conjugate().cast<T>() * Eigen::Map<const Eigen::Quaternion<T>>(pose);
        Eigen::Map<Vector3<T>> turn(residual);
        turn = vector_of<T>(apart) * T(1e3);
        for (int k = 0; k < 3; ++k)
            residual[3 + k] = (pose[4 + k] - measured[4 + k]) * T(1e2);
        return true;
    }
};

int main()
{
    static strapgen::imu<4000> imu(200.0, 1.4e-4, 8e-4);
    std::size_t samples, images;
    std::cin >> samples >> images;
    for (std::size_t k = 0; k < samples; ++k) {
        int64_t stamp;
        std::array<double, 3> angle, force;
        std::cin >> stamp >> angle[0] >> angle[1] >> angle[2] >> force[0] >> force[1] >> force[2];
        if (!std::cin || imu.push(stamp, angle, force) != strapgen::imu_status::ok)
            return 1;
    }
    std::vector<int64_t> stamps(images);
    std::vector<std::array<double, 7>> poses(images);
    std::vector<Eigen::Vector3d> velocities(images, Eigen::Vector3d::Zero());
    Eigen::Matrix<double, 6, 1> biases = Eigen::Matrix<double, 6, 1>::Zero();
    ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<3>> of_pose;
    ceres::EuclideanManifold<3> of_velocity;
    ceres::EuclideanManifold<6> of_biases;
    ceres::Problem::Options owner;
    owner.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres::Problem problem(owner);
    for (std::size_t k = 0; k < images; ++k) {
        std::cin >> stamps[k];
        for (double &number : poses[k])
            std::cin >> number;
        problem.AddParameterBlock(poses[k].data(), 7, &of_pose);
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<PoseCost, 6, 7>(new PoseCost{ poses[k] }), nullptr, poses[k].data());
        if (k == 0)
            continue;
        strapgen::imu_factor factor;
        const std::array<double, 3> none = {};
        if (imu.between(stamps[k - 1], stamps[k], none, none, factor) != strapgen::imu_status::ok)
            return 1;
        auto *cost = new ceres::AutoDiffCostFunction<ImuCost, 9, 7, 3, 7, 3, 6>(new ImuCost(factor));
        const std::vector<double *> states = { poses[k - 1].data(), velocities[k - 1].data(), poses[k].data(),
            velocities[k].data(), biases.data() };
        problem.AddResidualBlock(cost, nullptr, states);
        if (k > 1)
            continue;
        const std::vector<const ceres::Manifold *> manifolds = { &of_pose, &of_velocity, &of_pose, &of_velocity,
            &of_biases };
        ceres::GradientChecker::ProbeResults found;
        ceres::GradientChecker(cost, &manifolds, ceres::NumericDiffOptions()).Probe(states.data(), 1e-6, &found);
        std::cout.precision(12);
        std::cout << "derivatives, off by " << found.maximum_relative_error << "\nerrors " << found.residuals.transpose()
                  << '\n';
    }
    ceres::Solver::Summary summary;
    ceres::Solver::Options options;
    options.function_tolerance = 1e-12;
    ceres::Solve(options, &problem, &summary);
    std::cout << "biases " << biases.transpose() << "\nvelocity " << velocities.back().transpose() << '\n';
    return summary.IsSolutionUsable() ? 0 : 1;
}
