// SPDX-License-Identifier: BSD-3-Clause
// What a line of NMEA 0183 may do to the decoder, without a peer: sentences printed in public
// documents, those that say that they have nothing, order, damage.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "icat/adapters/local_ned.hpp"
#include "icat/adapters/nmea.hpp"
#include "icat/adapters/nmea_sentence.hpp"
#include "icat/navigation/position_estimator.hpp"

namespace {

using icat::NmeaDecoder;
using icat::NmeaSentence;
using icat::Status;

constexpr double degree = std::numbers::pi / 180;

std::span<const std::uint8_t> bytes(const std::string& s) {
  return {reinterpret_cast<const std::uint8_t*>(s.data()), s.size()};
}
std::string summed(const std::string& body) { return std::string(NmeaSentence(body).view()); }
int put(NmeaDecoder& nmea, const std::string& s, double now = 0) { return nmea.put(bytes(s), now); }

TEST(Nmea, SentencesOfPublicDocuments) {
  // "NMEA Revealed" (gpsd), and the reference pages that it cites.
  NmeaDecoder nmea;
  EXPECT_EQ(put(nmea, "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n", 3),
            1);
  const auto& fix = nmea.position().value;
  EXPECT_NEAR(fix.latitude, (48 + 7.038 / 60) * degree, 1e-15);
  EXPECT_NEAR(fix.longitude, (11 + 31.0 / 60) * degree, 1e-15);
  EXPECT_EQ(fix.utc, 12 * 3600 + 35 * 60 + 19);
  EXPECT_EQ(fix.quality, icat::NmeaQuality::autonomous);
  EXPECT_EQ(fix.satellites, 8);
  EXPECT_EQ(fix.hdop, 0.9);
  EXPECT_EQ(fix.altitude, 545.4);
  EXPECT_EQ(fix.geoid, 46.9);
  EXPECT_EQ(nmea.position().time, 3);

  EXPECT_EQ(put(nmea, "$GPRMC,225446,A,4916.45,N,12311.12,W,000.5,054.7,191194,020.3,E*68\r\n", 9),
            1);
  EXPECT_NEAR(fix.latitude, (49 + 16.45 / 60) * degree, 1e-15);
  EXPECT_NEAR(fix.longitude, -(123 + 11.12 / 60) * degree, 1e-15);
  EXPECT_NEAR(nmea.velocity().value.speed, 0.5 * 1852 / 3600, 1e-15);
  EXPECT_NEAR(nmea.velocity().value.course, 54.7 * degree, 1e-15);
  EXPECT_NEAR(nmea.variation().value, 20.3 * degree, 1e-15);
  EXPECT_EQ(nmea.utc().value, 785285686);  // date -u -d '1994-11-19 22:54:46' +%s

  NmeaDecoder another;
  EXPECT_EQ(put(another, "$GPGLL,4916.45,N,12311.12,W,225444,A,*1D\r\n"), 1);
  EXPECT_NEAR(another.position().value.longitude, -(123 + 11.12 / 60) * degree, 1e-15);
  EXPECT_EQ(put(nmea, "$GPVTG,054.7,T,034.4,M,005.5,N,010.2,K*48\r\n"), 1);
  EXPECT_NEAR(nmea.velocity().value.speed, 5.5 * 1852 / 3600, 1e-15);
  EXPECT_EQ(put(nmea, "$HCHDG,101.1,,,7.1,W*3C\r\n"), 1);
  EXPECT_NEAR(nmea.magnetic_heading().value, 101.1 * degree, 1e-15);
  EXPECT_NEAR(nmea.true_heading().value, 94 * degree, 1e-15);
  EXPECT_EQ(put(nmea, "$GPZDA,160012.71,11,03,2004,-1,00*7D\r\n"), 1);
  EXPECT_NEAR(nmea.utc().value, 1079020812.71, 1e-6);
}

TEST(Nmea, DepthWithItsReference) {
  NmeaDecoder nmea;
  const auto& depth = nmea.depth().value;
  EXPECT_EQ(put(nmea, summed("SDDPT,12.4,1.5,100")), 1);
  EXPECT_EQ(depth.depth, 12.4);
  EXPECT_EQ(depth.offset, 1.5);
  EXPECT_EQ(depth.datum, icat::NmeaDepth::Datum::transducer);
  EXPECT_EQ(put(nmea, summed("SDDPT,12.4,-0.5")), 1);
  EXPECT_EQ(depth.offset, -0.5);
  EXPECT_EQ(put(nmea, summed("SDDBS,,f,7.25,M,,F")), 1);
  EXPECT_EQ(depth.depth, 7.25);
  EXPECT_EQ(depth.datum, icat::NmeaDepth::Datum::surface);
  EXPECT_EQ(put(nmea, summed("SDDBK,100,f,,M,,F")), 1);
  EXPECT_DOUBLE_EQ(depth.depth, 30.48);
  EXPECT_EQ(depth.datum, icat::NmeaDepth::Datum::keel);
  EXPECT_EQ(put(nmea, summed("SDDBT,,f,,M,10,F")), 1);
  EXPECT_DOUBLE_EQ(depth.depth, 18.288);
}

TEST(Nmea, WhatSaysThatItHasNothingChangesNothing) {
  NmeaDecoder nmea;
  for (const char* body :
       {"GPGGA,123519,4807.038,N,01131.000,E,0,08,0.9,545.4,M,46.9,M,,",
        "GPGGA,123519,4807.038,N,01131.000,E,6,08,0.9,545.4,M,46.9,M,,",
        "GPGGA,123519,4807.038,N,01131.000,E,8,08,0.9,545.4,M,46.9,M,,",
        "GPGGA,123519,,,,,1,08,0.9,545.4,M,46.9,M,,", "GPGGA,,,,,,0,,,,,,,,",
        "GPRMC,123519,V,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W",
        "GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W,N",
        "GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W,E",
        "GPGLL,4916.45,N,12311.12,W,225444,V", "GPGLL,4916.45,N,12311.12,W,225444,A,N",
        "GPVTG,054.7,T,034.4,M,005.5,N,010.2,K,N", "GPVTG,,T,,M,,N,,K", "SDDPT,,0.0",
        "SDDBT,,f,,M,,F", "HEHDT,,T", "HETHS,77.5,V", "HETHS,77.5,E", "HCHDG,,,,,",
        "GPZDA,,,,,,"}) {
    EXPECT_EQ(put(nmea, summed(body)), 0) << body;
    EXPECT_EQ(nmea.status(), Status::not_measured) << body;
  }
  EXPECT_FALSE(nmea.position().fresh(0, 1e9));
  // Those of a simulator are taken by who says so.
  NmeaDecoder any({.satellites_only = false});
  EXPECT_EQ(put(any, summed("GPGGA,123519,4807.038,N,01131.000,E,8,08,0.9,545.4,M,46.9,M,,")), 1);
  EXPECT_EQ(put(any, summed("HETHS,77.5,A")), 1);
  EXPECT_NEAR(any.true_heading().value, 77.5 * degree, 1e-15);
}

TEST(Nmea, WhatIsOutOfRangeOrMalformedChangesNothing) {
  NmeaDecoder nmea;
  for (const char* body : {"GPGLL,9000.001,N,12311.12,W,225444,A",
                           "GPGLL,4960.00,N,12311.12,W,225444,A",
                           "GPGLL,4916.45,N,18000.01,W,225444,A",
                           "GPGLL,4916.45,E,12311.12,W,225444,A",
                           "GPGLL,4916.45,,12311.12,W,225444,A",
                           "GPGLL,916.45,N,12311.12,W,225444,A",
                           "GPGLL,49 6.45,N,12311.12,W,225444,A",
                           "GPGLL,4916.45,N,12311.12,W,245444,A",
                           "GPGLL,4916.45,N,12311.12,W,225461,A",
                           "GPGLL,4916.45,N,12311.12,W,22544,A",
                           "GPGLL,4916.45,N,12311.12,W,225444,X",
                           "GPGLL,4916.45,N,12311.12,W",
                           "HEHDT,360.1,T",
                           "HEHDT,-1,T",
                           "HEHDT,1e2,T",
                           "HEHDT,nan,T",
                           "HEHDT,0x10,T",
                           "HEHDT,12.3.4,T",
                           "HEHDT,12.3,M",
                           "HEHDT,12.3",
                           "HCHDM,12.3,T",
                           "SDDPT,-1,0",
                           "SDDPT,99999,0",
                           "SDDPT,1234567890123456789,0",
                           "GPZDA,160012.71,31,02,2004,00,00",
                           "GPZDA,160012.71,29,02,2003,00,00",
                           "GPZDA,160012.71,11111111111,03,2004,00,00",
                           "GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,320394,003.1,W",
                           "GPRMC,123519,A,4807.038,N,01131.000,E,-2.4,084.4,230394,003.1,W",
                           "GPVTG,400,T,034.4,M,005.5,N,010.2,K",
                           "GPVTG,054.7,T,034.4,M,005.5,K,010.2,K",
                           "GPGGA,123519,4807.038,N,01131.000,E,9,08,0.9,545.4,M,46.9,M,,",
                           "GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,F,46.9,M,,"}) {
    EXPECT_EQ(put(nmea, summed(body)), 0) << body;
    EXPECT_EQ(nmea.status(), Status::implausible) << body;
  }
  for (const char* line :
       {"$GPGLL,4916.45,N,12311.12,W,225444,A*32\r\n", "$GPGLL,4916.45,N,12311.12,W,225444,A\r\n",
        "$GPGLL,4916.45,N,12311.12,W,225444,A*3\r\n",
        "$GPGLL,4916.45,N,12311.12,W,225444,A*031\r\n",
        "GPGLL,4916.45,N,12311.12,W,225444,A*31\r\n", "$GPGLL*31\r\n", "$*00\r\n", "$\r\n"}) {
    EXPECT_EQ(put(nmea, line), 0) << line;
  }
  // What is no sentence of ours is none of our business.
  const auto before = nmea.damaged();
  EXPECT_EQ(put(nmea, summed("PASHR,1,2,3") + summed("GPGSV,3,1,11,03,03,111,00") +
                          summed("GPXXX,1") + summed("GP,1")),
            0);
  EXPECT_EQ(nmea.damaged(), before);
  NmeaDecoder trusting({.checksum_required = false});
  EXPECT_EQ(put(trusting, "$GPGLL,4916.45,N,12311.12,W,225444,A\r\n"), 1);
  EXPECT_THROW(NmeaDecoder({.restart_after = 0}), std::invalid_argument);
}

std::string gll(const char* utc, const char* minutes = "16.45") {
  return summed(std::string("GPGLL,49") + minutes + ",N,12311.12,W," + utc + ",A");
}

TEST(Nmea, ThreeSentencesOfOneTimeAreOneFix) {
  NmeaDecoder nmea;
  EXPECT_EQ(put(nmea, gll("225444.00"), 1), 1);
  EXPECT_EQ(put(nmea, summed("GPGGA,225444,4916.45,N,12311.12,W,4,08,0.9,5.5,M,46.9,M,,"), 1.1), 0);
  EXPECT_EQ(nmea.position().count, 1u);
  EXPECT_EQ(nmea.position().time, 1);
  EXPECT_EQ(nmea.position().value.altitude, 5.5);
  EXPECT_EQ(put(nmea, gll("225444.00"), 1.2), 0);  // doubled
  // A receiver that repeats itself has no fix.
  for (int k = 0; k < 20; ++k) EXPECT_EQ(put(nmea, gll("225444.00"), 2 + k), 0);
  EXPECT_FALSE(nmea.position().fresh(22, 20));
}

TEST(Nmea, ADoubledRmcMakesNoVelocityFresh) {
  NmeaDecoder nmea;
  const std::string rmc =
      summed("GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W");
  const std::string zda = summed("GPZDA,160012.71,11,03,2004,00,00");
  EXPECT_EQ(put(nmea, rmc, 1), 1);
  EXPECT_EQ(put(nmea, rmc, 2), 0);
  EXPECT_EQ(nmea.velocity().time, 1);
  EXPECT_EQ(nmea.utc().time, 1);
  EXPECT_EQ(put(nmea, zda, 3), 1);
  EXPECT_EQ(put(nmea, zda, 4), 0);
  EXPECT_EQ(nmea.utc().time, 3);
  // GGA first, as most receivers send it: the velocity is new all the same.
  EXPECT_EQ(put(nmea, summed("GPGGA,123520,4807.038,N,01131.000,E,1,08,0.9,5.4,M,46.9,M,,"), 5), 1);
  EXPECT_EQ(put(nmea, summed("GPRMC,123520,A,4807.038,N,01131.000,E,1,2,230394,,"), 5), 1);
  EXPECT_EQ(nmea.velocity().time, 5);
}

TEST(Nmea, WhatIsLateIsRefusedUntilTheReceiverBeganAnew) {
  NmeaDecoder nmea;
  EXPECT_EQ(put(nmea, gll("225444.20", "16.45"), 1), 1);
  EXPECT_EQ(put(nmea, gll("225444.10", "16.00"), 1.1), 0);
  EXPECT_EQ(nmea.status(), Status::time_reversed);
  EXPECT_NEAR(nmea.position().value.latitude, (49 + 16.45 / 60) * degree, 1e-15);
  EXPECT_EQ(put(nmea, gll("225444.10", "16.00"), 3.5), 1);  // after 2 s of silence
  // Midnight.
  EXPECT_EQ(put(nmea, gll("235959.90"), 4), 1);
  EXPECT_EQ(put(nmea, gll("000000.00"), 4.1), 1);
  EXPECT_EQ(put(nmea, gll("235959.95"), 4.2), 0);
}

// A sentence without time is a fix, yet the last time is known all the same.
TEST(Nmea, AFixWithoutTimeDoesNotMakeADoubledOneNew) {
  NmeaDecoder nmea;
  const std::string gga = summed("GPGGA,225444,4916.45,N,12311.12,W,4,08,0.9,5.5,M,46.9,M,,");
  EXPECT_EQ(put(nmea, gga, 1), 1);
  EXPECT_EQ(put(nmea, summed("GPGLL,4917.00,N,12311.12,W,,A"), 1.1), 1);
  EXPECT_EQ(put(nmea, gga, 1.2), 0);
  EXPECT_EQ(put(nmea, gll("225443.00"), 1.3), 0);
  EXPECT_EQ(nmea.status(), Status::time_reversed);
  EXPECT_NEAR(nmea.position().value.latitude, (49 + 17.0 / 60) * degree, 1e-15);
  EXPECT_FALSE(nmea.position().value.has_altitude);  // that of another place
  EXPECT_EQ(nmea.position().time, 1.1);
  // Those without time do not keep a receiver out that began anew.
  EXPECT_EQ(put(nmea, summed("GPGLL,4917.00,N,12311.12,W,,A"), 3), 1);
  EXPECT_EQ(put(nmea, gll("225440.00"), 3.1), 1);
}

TEST(Nmea, TimeDoesNotRunBackwards) {
  NmeaDecoder nmea;
  EXPECT_EQ(put(nmea, summed("GPZDA,160012.00,11,03,2004,00,00"), 1), 1);
  EXPECT_EQ(put(nmea, summed("GPZDA,160011.00,11,03,2004,00,00"), 1.1), 0);
  EXPECT_EQ(nmea.status(), Status::time_reversed);
  // An RMC that was under way for longer is a fix, yet no time.
  EXPECT_EQ(put(nmea, summed("GPRMC,160011,A,4807.038,N,01131.000,E,1,2,110304,,"), 1.2), 1);
  EXPECT_EQ(nmea.utc().value, 1079020812);
  EXPECT_EQ(nmea.utc().time, 1);
  EXPECT_EQ(put(nmea, summed("GPZDA,160013.00,11,03,2004,00,00"), 1.3), 1);
  // A receiver that began anew, with the clock that it is sold with.
  EXPECT_EQ(put(nmea, summed("GPZDA,000000.00,06,01,1980,00,00"), 2), 0);
  EXPECT_EQ(put(nmea, summed("GPZDA,000002.00,06,01,1980,00,00"), 4), 1);
  EXPECT_EQ(nmea.utc().value, 315964802);
}

// Sentences whose values are told apart from all damaged ones.
const std::string& clean() {
  static const std::string all =
      summed("GPGGA,123519.25,4807.0380000,N,01131.0001234,E,1,08,0.9,545.4,M,46.9,M,,") +
      summed("GPRMC,123520.25,A,4807.0381,N,01131.0005,E,022.4,084.4,230394,003.1,W,A") +
      summed("HCHDG,101.1,2.0,E,7.1,W") + summed("SDDPT,12.44,1.5") +
      summed("GPVTG,054.7,T,034.4,M,005.5,N,010.2,K,A") +
      summed("GPZDA,160012.71,11,03,2004,00,00") + summed("SDDBT,36.1,f,11.0,M,6.0,F");
  return all;
}

// Every value that `nmea` holds is 0, as before the first, or of `clean`.
void expect_clean(const NmeaDecoder& nmea) {
  const auto one_of = [](double value, std::initializer_list<double> list) {
    for (const double x : list) {
      if (std::abs(value - x) < 1e-12 * std::max(1.0, std::abs(x))) return true;
    }
    return false;
  };
  EXPECT_TRUE(one_of(nmea.position().value.latitude,
                     {0, (48 + 7.038 / 60) * degree, (48 + 7.0381 / 60) * degree}));
  EXPECT_TRUE(one_of(nmea.position().value.longitude,
                     {0, (11 + 31.0001234 / 60) * degree, (11 + 31.0005 / 60) * degree}));
  EXPECT_TRUE(one_of(nmea.position().value.altitude, {0, 545.4}));
  EXPECT_TRUE(one_of(nmea.velocity().value.speed, {0, 22.4 * 1852 / 3600, 5.5 * 1852 / 3600}));
  EXPECT_TRUE(one_of(nmea.velocity().value.course, {0, 84.4 * degree, 54.7 * degree}));
  EXPECT_TRUE(one_of(nmea.depth().value.depth, {0, 12.44, 11}));
  EXPECT_TRUE(one_of(nmea.magnetic_heading().value, {0, 103.1 * degree}));
  EXPECT_TRUE(one_of(nmea.true_heading().value, {0, 96 * degree}));
  EXPECT_TRUE(one_of(nmea.utc().value, {0, 764426120.25, 1079020812.71}));
}

TEST(Nmea, NoSingleBitMakesAWrongValue) {
  for (std::size_t i = 0; i < clean().size(); ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string damaged = clean();
      damaged[i] = static_cast<char>(damaged[i] ^ (1 << bit));
      NmeaDecoder nmea;
      put(nmea, damaged);
      expect_clean(nmea);
      ASSERT_FALSE(HasFailure()) << i << " " << bit;
    }
  }
}

TEST(Nmea, WhatIsCutOrSurroundedByGarbageCostsNoOtherSentence) {
  std::mt19937 random(1);
  for (std::size_t cut = 0; cut < clean().size(); ++cut) {
    NmeaDecoder nmea;
    put(nmea, clean().substr(0, cut));
    expect_clean(nmea);
    // The next whole one is decoded, whatever came before.
    std::string garbage(random() % 300, ' ');
    for (char& c : garbage) c = static_cast<char>(random());
    const auto before = nmea.depth().count;
    put(nmea, garbage);
    put(nmea, summed("SDDPT,12.44,1.5"));
    EXPECT_GT(nmea.depth().count, before);
    expect_clean(nmea);
    ASSERT_FALSE(HasFailure()) << cut;
  }
  // Too long for any sentence.
  NmeaDecoder nmea;
  put(nmea, "$GPGLL," + std::string(1000, '1'));
  EXPECT_EQ(put(nmea, gll("225444.00")), 1);
}

TEST(Nmea, EncodedAndDecodedIsTheSame) {
  std::mt19937 random(3);
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  for (int k = 0; k < 20000; ++k) {
    NmeaDecoder nmea;
    icat::NmeaPosition p;
    p.latitude = uniform(-90, 90) * degree;
    p.longitude = uniform(-180, 180) * degree;
    p.utc = std::floor(uniform(0, 8639999)) / 100;
    p.quality = icat::NmeaQuality::rtk;
    p.has_altitude = true;
    p.altitude = uniform(-100, 9000);
    p.geoid = uniform(-100, 100);
    p.hdop = 1.25;
    p.satellites = k % 30;
    const icat::NmeaVelocity v{uniform(0, 100), true, uniform(0, 6.283)};
    const double utc = 86400 * std::floor(uniform(3652, 40176)) + p.utc;
    const double heading = uniform(-10, 10);
    ASSERT_EQ(nmea.put(NmeaSentence::gga(p).bytes(), 0), 1) << NmeaSentence::gga(p).view();
    const auto& got = nmea.position().value;
    // 1e-7 minutes are 2.9e-11 rad; half of that by rounding.
    ASSERT_NEAR(got.latitude, p.latitude, 1.5e-11);
    ASSERT_NEAR(got.longitude, p.longitude, 1.5e-11);
    ASSERT_NEAR(got.utc, p.utc, 1e-9);
    ASSERT_NEAR(got.altitude, p.altitude, 5.1e-4);
    ASSERT_NEAR(got.geoid, p.geoid, 5.1e-4);
    ASSERT_EQ(got.satellites, p.satellites);
    ASSERT_EQ(got.hdop, 1.25);
    NmeaDecoder other;
    ASSERT_EQ(other.put(NmeaSentence::rmc(p, v, utc).bytes(), 0), 1);
    ASSERT_NEAR(other.utc().value, utc, 5.1e-3);
    ASSERT_NEAR(other.velocity().value.speed, v.speed, 3e-5);
    ASSERT_NEAR(other.velocity().value.course, v.course, 1e-6);
    ASSERT_EQ(other.put(NmeaSentence::hdt(heading).bytes(), 0), 1);
    ASSERT_NEAR(std::remainder(other.true_heading().value - heading, 2 * std::numbers::pi), 0,
                1e-6);
    ASSERT_EQ(other.put(NmeaSentence::dpt({p.altitude + 100, {}, p.geoid}).bytes(), 0), 1);
    ASSERT_NEAR(other.depth().value.offset, p.geoid, 5.1e-4);
  }
  EXPECT_TRUE(NmeaSentence::hdt(std::nan("")).view().empty());
  EXPECT_TRUE(NmeaSentence::dpt({1e300, {}, 0}).view().empty());
  EXPECT_TRUE(NmeaSentence::gga({2, 0, 0}).view().empty());
  for (const double year_without_digits : {-1.0, 315532799.0, 3471292800.0}) {
    EXPECT_TRUE(NmeaSentence::rmc({}, {}, year_without_digits).view().empty());
  }
  EXPECT_TRUE(NmeaSentence(std::string(200, 'A')).view().empty());
  EXPECT_TRUE(NmeaSentence("GPXXX,$").view().empty());
}

TEST(Nmea, FeedsThePositionEstimator) {
  const icat::LocalNed origin({44.0 * degree, 9.8 * degree, 0});
  icat::PositionEstimator<double> estimator({0, 0, 0});
  const icat::Matrix3<double> small = icat::Matrix3<double>::Identity() * 1e-4;
  const icat::Matrix3<double> attitude = icat::Matrix3<double>::Identity();
  NmeaDecoder nmea;
  std::uint32_t fixes = 0, depths = 0;
  const icat::Geodetic place = origin.geodetic({5, -3, 0});
  for (int k = 0; k < 200; ++k) {
    const double now = 0.1 * k;
    icat::NmeaPosition p;
    p.latitude = place.latitude;
    p.longitude = place.longitude;
    p.utc = now;
    p.quality = icat::NmeaQuality::autonomous;
    std::string line = std::string(NmeaSentence::gga(p).view()) + summed("SDDBS,,f,0.30,M,,F");
    EXPECT_EQ(estimator.predict(icat::Vector3<double>(0, 0, 0), small, attitude, 0.1), Status::ok);
    const auto came = bytes(line);
    //! [nmea]
    nmea.put(came, now);
    if (const auto& fix = nmea.position(); fix.count != fixes) {
      fixes = fix.count;
      const auto ned = origin.ned(fix.value.latitude, fix.value.longitude);
      (void)estimator.correct_gps({ned[0], ned[1]}, now - fix.time);
    }
    // Only from a pressure sensor: an echo sounder measures the depth of the water.
    if (const auto& depth = nmea.depth(); depth.count != depths) {
      depths = depth.count;
      (void)estimator.correct_depth(depth.value.depth, now - depth.time);
    }
    const bool lost = !nmea.depth().fresh(now, 0.5);  // then stop the robot
    //! [nmea]
    EXPECT_FALSE(lost);
  }
  EXPECT_EQ(fixes, 200u);
  EXPECT_NEAR(estimator.position()(0), 5, 0.05);
  EXPECT_NEAR(estimator.position()(1), -3, 0.05);
  EXPECT_NEAR(estimator.position()(2), 0.3, 0.01);
}

TEST(LocalNed, AxesAndWayBack) {
  const icat::LocalNed origin({0.7, 0.2, 100});
  EXPECT_NEAR(origin.ned({0.7, 0.2, 90})[2], 10, 1e-9);
  EXPECT_GT(origin.ned({0.7001, 0.2, 100})[0], 600);
  EXPECT_GT(origin.ned({0.7, 0.2001, 100})[1], 400);
  // The way back over the whole earth, also at the poles.
  for (double latitude = -90; latitude <= 90; latitude += 7.5) {
    const icat::LocalNed here({latitude * degree, 1, 0});
    for (double north : {-50000.0, 0.0, 300.0}) {
      for (double down : {-4000.0, 0.0, 9000.0}) {
        const std::array<double, 3> ned{north, 1234.5, down};
        const auto back = here.ned(here.geodetic(ned));
        for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(back[i], ned[i], 1e-6) << latitude;
      }
    }
  }
  EXPECT_THROW(icat::LocalNed({44, 9, 0}), std::invalid_argument);
  EXPECT_THROW(icat::LocalNed({0.5, std::nan(""), 0}), std::invalid_argument);
}

}  // namespace
